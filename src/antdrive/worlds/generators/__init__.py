"""Generators of random worlds."""
