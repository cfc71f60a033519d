"""What commands do with a described system in place of an algorithm."""
