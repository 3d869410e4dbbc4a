"""Logs of drives, with metrics, certificate and consistency checks computed from them alone."""
