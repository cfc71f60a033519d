"""Monte Carlo of sensor errors beside closed forms."""
