"""Failures: minimal reproducers, and a search for worlds in which a configuration fails."""
