"""An application of your own: a kernel, methods, a motion, a target, a back end, a study and its command."""
