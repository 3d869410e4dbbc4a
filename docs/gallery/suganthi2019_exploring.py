"""
Ants that explore (Suganthi 2019)
=================================

Suganthi and Subha (2019) use two kinds of ants: common ants follow pheromone, exploratory ants prefer moves with little of
it. Here their colony, the ant system and Lee's ants search a random map of 20 × 20 cells whose shortest path is as long as
the paper's. All step back out of dead ends and cut loops short. Parameters are the paper's; where it prints none for Lee's
ants, they are those of Lee et al. (2008) or ours.
"""

import numpy as np
from antdrive import film, load_planner, plan, run
from antdrive.planners import Query
from antdrive.runs.papers.experiments import PAPERS
from antdrive.views.figures.paper_figures import history_figure, maps_figure
from antdrive.views.papers import paper_scenario

scenario = paper_scenario("suganthi2019")
grid, _ = plan(scenario)
query = Query.between(grid, scenario.task)

# %%
# Path length by iteration
# ------------------------
# Lines are medians of five seeds, bands their range.

options = {
    one.name: one.options for one in PAPERS["suganthi2019"]() if one.map == "20×20"
}
planners = {
    name: load_planner(name, **options[name]) for name in ("iaco", "as", "pfaco")
}
plans = {
    name: [one.plan(query, np.random.default_rng(seed)) for seed in range(5)]
    for name, one in planners.items()
}
for name, found in plans.items():
    lengths = [one.cost for one in found]
    print(f"{name:>5}: paths of {min(lengths):.1f} to {max(lengths):.1f} m")
iterations = history_figure(
    {name: [one.history for one in found] for name, found in plans.items()}
)

# %%
# Paths
# -----
# The first seed of each planner.

paths = maps_figure(
    {"20 × 20": (query, {name: found[0] for name, found in plans.items()})}
)

# %%
# Search and drive
# ----------------
# The first 3 s of the film show the colony's search.

# sphinx_gallery_thumbnail_number = -1

result = run(scenario)
print(result.outcome.value)
film(
    result.rollout,
    "exploring.mp4",
    camera="top",
    size=(480, 480),
    speed=5,
    prelude=3.0,
)
