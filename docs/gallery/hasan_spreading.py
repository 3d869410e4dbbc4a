"""
Pheromone that spreads from the goal (Hasan)
============================================

In Hasan's planner pheromone spreads from the goal over all free cells, and a single ant follows it, cell by cell. Where
something stands in the way it is spread anew, much as D* repairs its costs. Here are the paper's curved walls, recreated,
with the paper's mover: it goes to a random neighbouring cell every 0.8 s.
"""

from antdrive import Scenario, film, plan, run
from antdrive.views import overview, plan_figure

scenario = Scenario.of("hasan-1a-moving", "mmas-dstar", seed=0)

# %%
# The field
# ---------
# The ant goes to the neighbour with the least pheromone, weighed with the straight distance to the goal. As the field grows
# along the way around walls, it need not search.

grid, found = plan(scenario)
print(f"{found.status.value}: {found.cost:.2f} m")
field = plan_figure(scenario.task, grid, found, scenario.robot)

# %%
# The drive
# ---------

result = run(scenario)
print(result.outcome.value)
print(
    f"{result.metrics['duration_s']:.0f} s, {result.metrics['replans']:.0f} new routes"
)
film(result.rollout, "spreading.mp4", camera="top", size=(640, 560), speed=6)

# %%
# What slowed it down
# -------------------

drive = overview(result.rollout)
