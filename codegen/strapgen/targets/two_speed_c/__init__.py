"""The target that prints the C of all loops of an algorithm in two speeds."""
