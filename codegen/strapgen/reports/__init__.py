"""Results as text, tables, JSON, CSV and pictures."""
