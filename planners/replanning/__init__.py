"""Planners that answer again while the world changes."""
