"""
Ants that explore (Suganthi 2019)
=================================

Suganthi and Subha (2019) use two kinds of ants: common ants follow pheromone, exploratory ants prefer moves with little of
it. Here their colony, the ant system and Lee's ants search a random map of 20 × 20 cells whose shortest path is as long as
the paper's. All step back out of dead ends and cut loops short. Parameters are the paper's; where it prints none for Lee's
ants, they are those of Lee et al. (2008) or ours.
"""

import matplotlib.pyplot as plt
import numpy as np
from antdrive import load_planner, plan, run
from antdrive.planners import Query
from antdrive.runs.papers.experiments import PAPERS
from antdrive.views import write_view
from antdrive.views.figures.paper_figures import maps_figure
from antdrive.views.papers import experiment_scenario

experiments = {
    one.name: one for one in PAPERS["suganthi2019"]() if one.map == "20×20"
}
scenario = experiment_scenario(experiments["iaco"])
grid, _ = plan(scenario)
query = Query.between(grid, scenario.task)

# %%
# Path length by iteration
# ------------------------
# A line a seed.

planners = {
    name: load_planner(name, **experiments[name].options)
    for name in ("iaco", "as", "pfaco")
}
plans = {
    name: [one.plan(query, np.random.default_rng(seed)) for seed in range(5)]
    for name, one in planners.items()
}
for name, found in plans.items():
    lengths = [one.cost for one in found]
    print(f"{name:>5}: paths of {min(lengths):.1f} to {max(lengths):.1f} m")
iterations, axes = plt.subplots()
for k, (name, found) in enumerate(plans.items()):
    for seed, one in enumerate(found):
        label = name if seed == 0 else None
        axes.step(
            range(len(one.history)), one.history.best, color=f"C{k}", label=label
        )
axes.set(xlabel="iteration", ylabel="best path so far [m]")
axes.legend()

# %%
# Paths
# -----
# The first seed of each planner.

paths = maps_figure(
    {"20 × 20": (query, {name: found[0] for name, found in plans.items()})}
)

# %%
# The drive
# ---------

# sphinx_gallery_thumbnail_number = -1

result = run(scenario)
print(result.outcome.value)
write_view(result.rollout, "exploring.html")
