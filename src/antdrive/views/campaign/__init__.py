"""Pages and tables about a campaign: thousands of runs, compared planner by planner."""
