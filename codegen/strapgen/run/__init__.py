"""Running generated code: building through cffi, callable back ends, exact arithmetic, files that a command writes."""
