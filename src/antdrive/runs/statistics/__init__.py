"""Statistics over many runs: intervals, paired comparisons, profiles. Pure functions of arrays."""
