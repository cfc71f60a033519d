"""The targets that print Rust without its standard library, one module a function."""
