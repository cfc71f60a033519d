"""How objects and formulas are shown: LaTeX, HTML for notebooks, and the data frames of other libraries."""
