"""Tells names of motions from names of files; it needs nothing of what runs motions."""


def is_file(name: str) -> bool:
    """Tell whether the name of a motion is that of a file."""
    return name.endswith(".py")
