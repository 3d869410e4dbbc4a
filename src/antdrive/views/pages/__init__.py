"""Reports of runs and campaigns as pages and tables."""
