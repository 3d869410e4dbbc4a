"""
Pheromone that spreads from the goal (Hasan)
============================================

In Hasan's planner, pheromone spreads from the goal until it reaches the robot, and a single ant follows it cell by cell. The
ant skips the mover's cell; after four waits pheromone spreads again, a rule of ours. This world is drawn by hand from the
paper's text: curved walls, and one mover, which steps to a random neighbouring cell every 0.8 s.
"""

from antdrive import Scenario, plan, run
from antdrive.views import overview, plan_figure, write_view

scenario = Scenario.of("hasan-1a-moving", "mmas-dstar", seed=0)

# %%
# The field
# ---------
# The ant moves to the neighbour with the least pheromone, weighted with the straight-line distance to the goal. Pheromone
# grows along the paths around walls, so the ant only compares neighbours.

grid, found = plan(scenario)
print(f"{found.status.value}: {found.cost:.2f} m")
field = plan_figure(scenario.task, grid, found, scenario.robot)

# %%
# The drive
# ---------

result = run(scenario)
print(result.outcome.value)
print(
    f"{result.metrics['duration_s']:.0f} s, {result.metrics['replans']:.0f} replans"
)
write_view(result.rollout, "spreading.html")

# %%
# Clearance and speed
# -------------------

drive = overview(result.rollout)
