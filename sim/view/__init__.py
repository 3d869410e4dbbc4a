"""Figures, films, reports and the live window."""
