"""Named variants of generated code, in `strapgen.toml` or below `[tool.strapgen]` of `pyproject.toml`."""
