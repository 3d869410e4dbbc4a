"""Path smoothing: the plan's line, pulled taut, or with more clearance."""
