"""Kernels of an attitude and heading reference: levelling, heading and vertical loops, and what they feed back."""
