"""Failures made small and searched for: the smallest world that still fails, and worlds in which a set-up fails."""
