"""Gathers what strapgen knows of algorithms, from the experiments that its commands run one by one."""
