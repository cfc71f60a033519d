"""How to integrate: Butcher tableaux, Taylor, Magnus, Munthe-Kaas and coning methods."""
