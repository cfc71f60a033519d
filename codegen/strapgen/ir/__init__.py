"""The forms that the stages exchange: signals, programs, integer programs and sources. No module here uses SymPy."""
