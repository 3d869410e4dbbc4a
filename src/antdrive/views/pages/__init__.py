"""Pages and tables of results: some runs, or a campaign's planners compared."""
