"""Units that commit late: a run of them on every back end, and recordings with gaps."""
