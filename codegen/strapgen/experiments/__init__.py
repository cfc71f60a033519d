"""Experiments measure with back ends: orders, tables, word lengths, agreement. `reports` prints their results."""
