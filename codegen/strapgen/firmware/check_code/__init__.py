"""Conformance tests of attitude steps written by others."""
