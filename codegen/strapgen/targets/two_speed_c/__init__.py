"""The C of all loops of an algorithm in two speeds."""
