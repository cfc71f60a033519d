"""Tables and statements of the thesis."""
