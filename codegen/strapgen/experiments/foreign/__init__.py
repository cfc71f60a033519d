"""Functions in C or C++ that users bring: how they are called, probed and diagnosed."""
