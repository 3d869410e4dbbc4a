"""Ant colonies on the grid."""
