"""Described systems in experiments: passes held to bounds, back ends side by side, cost, and a whole navigator."""
