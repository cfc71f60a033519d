"""C code that commits an attitude a few samples late, and estimates the present one."""
