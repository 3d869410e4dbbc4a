"""Planners that fail."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Raises:
    """Raise an error."""

    def plan(self, query, rng):
        """Raise an error."""
        raise ValueError("out of ideas")


@dataclass(frozen=True, kw_only=True)
class Wrong:
    """Return no plan."""

    def plan(self, query, rng):
        """Return a number."""
        return 7
