"""Numbers as words: coefficients that are rounded together, formats whose products need no shifts."""
