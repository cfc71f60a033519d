"""Motions of a body rate: profiles that are built in, and expressions that are integrated with proved bounds."""
