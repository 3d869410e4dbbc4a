"""Graph search on the grid, incremental search, safe-interval planning, and the potential field."""
