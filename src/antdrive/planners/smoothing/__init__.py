"""From a plan in cells to a route: its own line, pulled taut, or with more clearance."""
