"""The version of the package, which generated headers state."""

VERSION = "0.2.0"
