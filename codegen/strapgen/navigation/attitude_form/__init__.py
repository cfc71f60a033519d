"""Forms of the attitude, compared by cost."""
