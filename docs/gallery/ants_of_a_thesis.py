"""
Ants with a sense of direction (Han 2007)
=========================================

Han's ants choose the next cell by pheromone and by the direction of the goal (Han 2007, §4.2). Here 100 ants and
an elite search the thesis' map of 14 obstacles, and a robot drives their path.
"""

from antdrive import Scenario, plan, run
from antdrive.views import plan_figure, write_view

scenario = Scenario.of(
    "han2007-aco", "aco-han-elite", options={"ants": 100}, seed=4
)

# %%
# The plan
# --------
# Colours show the pheromone, the chart path lengths by iteration: walks grow. The colony does not learn: without pheromone the
# same ants find shorter paths. Ants walk from cell to cell, so the path is a staircase.

grid, found = plan(scenario)
print(f"{found.cost:.2f} m over {len(found.cells)} cells")
plan_found = plan_figure(scenario.task, grid, found, scenario.robot)

# %%
# The drive
# ---------
# Smoothing pulls the plan taut within its corridor and moves it away from obstacles.

result = run(scenario)
print(result.outcome.value)
print(
    f"{result.metrics['driven_length_m']:.2f} m driven in {result.metrics['duration_s']:.1f} s"
)
print(f"certified clearance: at least {result.certificate.bound:.3f} m")
write_view(result.rollout, "ants.html")
