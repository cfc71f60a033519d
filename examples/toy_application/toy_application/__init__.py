"""An application of one's own: a kernel, a study and its command."""
