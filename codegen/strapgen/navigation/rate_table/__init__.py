"""Rate-table tests: largest rates that an algorithm follows."""
