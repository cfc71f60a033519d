"""Monte Carlo of sensor errors and quantization."""
