"""Integration methods of attitude steps: Butcher tableaux, Taylor, Magnus, Munthe-Kaas and coning methods."""
