"""Agreement of predicted and simulated drift."""
