"""Control: pure pursuit, its speed rules, and local avoidance."""
