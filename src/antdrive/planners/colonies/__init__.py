"""Ant colony planners on the grid."""
