"""The drive loop."""
