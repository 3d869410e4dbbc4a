"""Figures and films of the papers."""
