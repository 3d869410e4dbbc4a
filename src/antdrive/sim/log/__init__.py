"""The log of a drive and everything computed from it alone."""
