"""Planners whose lines are not bound to grid directions."""
