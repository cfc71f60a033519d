"""What users bring: their files are loaded, and their kernels checked."""
