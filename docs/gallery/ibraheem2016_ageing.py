"""
Ants that age (Ibraheem 2016)
=============================

Ibraheem and Ajeil (2016) let later ants of an iteration deposit less pheromone, to encourage new paths. Here their colony and
the ant system search a map of 20 × 20 cells with ten obstacles, whose shortest path is as long as the printed one.
"""

import matplotlib.pyplot as plt
from antdrive import Scenario, plan, run
from antdrive.runs.papers.experiments import PAPERS
from antdrive.views import plan_figure, write_view
from antdrive.views.papers import experiment_scenario

experiments = {
    one.name: one for one in PAPERS["ibraheem2016"]() if one.map == "20×20"
}
ageing = experiment_scenario(experiments["maco"])

# %%
# Path length by iteration
# ------------------------
# A line a seed. See :doc:`the paper's page </papers/ibraheem2016>` for the verdict on each
# claim.

runs = {
    name: [plan(Scenario.of(ageing.task, name, seed=seed))[1] for seed in range(6)]
    for name in ("maco", "as")
}
for name, found in runs.items():
    print(f"{name:>4}: {', '.join(f'{one.cost:.1f}' for one in found)} m")
iterations, axes = plt.subplots()
for k, (name, found) in enumerate(runs.items()):
    for seed, one in enumerate(found):
        label = name if seed == 0 else None
        axes.step(
            range(len(one.history)), one.history.best, color=f"C{k}", label=label
        )
axes.set(xlabel="iteration", ylabel="best path so far [m]")
axes.legend()

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
write_view(result.rollout, "ageing.html")
