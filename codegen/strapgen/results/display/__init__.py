"""Forms of objects and formulas: LaTeX, HTML for notebooks, and the data frames of other libraries."""
