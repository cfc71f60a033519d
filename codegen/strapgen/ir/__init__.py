"""What the stages exchange: signals, programs, integer programs, sources. No SymPy."""
