"""Motions whose body rate is an expression: increments and attitude are integrated with proved bounds."""
