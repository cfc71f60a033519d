"""Algorithms that users bring: loading their files, and checking and caching their kernels."""
