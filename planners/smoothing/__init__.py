"""From cells to a route: smoothing."""
