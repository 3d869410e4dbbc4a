"""Robots out of other programs' files."""
