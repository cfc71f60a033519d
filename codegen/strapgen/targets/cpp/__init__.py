"""The targets that print C++17, one header a function, in floating point and in fixed point."""
