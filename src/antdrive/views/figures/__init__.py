"""Figures of runs, plans and papers as PNG, PDF or SVG."""
