"""An application of one's own: a kernel, methods, a motion, a target, a back end, a study and its command."""
