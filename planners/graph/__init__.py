"""Graph search on the grid, and its incremental and space-time forms."""
