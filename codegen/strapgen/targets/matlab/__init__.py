"""The target that prints functions for MATLAB and GNU Octave, one file each, in double."""
