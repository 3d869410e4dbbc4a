"""Control: pure pursuit, speed profiles and local avoidance."""
