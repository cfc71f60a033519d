"""Prints what builds and runs a generated C function: a CMake project and a main program."""
