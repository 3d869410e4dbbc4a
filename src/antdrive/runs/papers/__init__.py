"""Reproduction of the papers' experiments; start with `reproduce`."""
