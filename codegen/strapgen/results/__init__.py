"""Results as text, JSON, CSV, Markdown, LaTeX and images, and how objects show themselves."""
