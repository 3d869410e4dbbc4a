"""Graph search, incremental search, safe-interval planning and the potential field."""
