"""
Ants that age (Ibraheem 2016)
=============================

Ibraheem and Ajeil (2016) let later ants of an iteration deposit less pheromone, to encourage new paths. Here their colony and
the ant system search a map of 20 × 20 cells with ten obstacles, whose shortest path is as long as the printed one.
"""

from antdrive import Scenario, film, plan, run
from antdrive.views import plan_figure
from antdrive.views.figures.paper_figures import history_figure
from antdrive.views.papers import paper_scenario

ageing = paper_scenario("ibraheem2016")

# %%
# Path length by iteration
# ------------------------
# Lines are medians of six seeds, bands their range. See :doc:`the paper's page </papers/ibraheem2016>` for the verdict on each
# claim.

runs = {
    name: [plan(Scenario.of(ageing.task, name, seed=seed))[1] for seed in range(6)]
    for name in ("maco", "as")
}
for name, found in runs.items():
    print(f"{name:>4}: {', '.join(f'{one.cost:.1f}' for one in found)} m")
iterations = history_figure(
    {name: [one.history for one in found] for name, found in runs.items()}
)

# %%
# Final pheromone
# ---------------

grid, found = plan(ageing)
trail = plan_figure(ageing.task, grid, found, ageing.robot)

# %%
# The drive
# ---------

result = run(ageing)
print(result.outcome.value)
film(result.rollout, "ageing.mp4", camera="top", size=(480, 480), speed=5)
