"""Figures as PNG, PDF or SVG: of runs, of plans, and of the kinds that papers print."""
