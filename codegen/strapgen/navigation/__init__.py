"""Navigation: two speeds, described systems, instruments, loops, redundancy, calibration."""
