"""Reports write results as text, tables, JSON, CSV and pictures."""
