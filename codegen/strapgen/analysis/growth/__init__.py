"""Growth of the length of the state, and stability."""
