"""
Ants in a potential field (Lee 2008)
====================================

A potential field pulls the robot to the goal and pushes it away from obstacles. Descending it is quick, and ends in the
first valley. Lee, Kim, Choi and Lee (2008) let ants take the field as their heuristic instead.
"""

from antdrive import Scenario, film, plan, run
from antdrive.views import plan_figure
from antdrive.views.figures.plan_figures import contours_figure

# %%
# A valley
# --------
# The goal lies behind a U that opens towards the start. The descent ends inside the U, where every way leads uphill.

descent = Scenario.of("u-trap", "apf")
grid, stuck = plan(descent)
print(f"apf: {stuck.status.value}")
valley = plan_figure(descent.task, grid, stuck, descent.robot)

# %%
# Ants leave it
# -------------
# Ants choose by pheromone and by the field, at random, so some of them climb out. Behind the U the field is nearly flat, and
# they wander. The contours are their pheromone.

colony = Scenario.of("u-trap", "pfaco", options={"ants": 200}, seed=1)
grid, found = plan(colony)
print(f"pfaco: {found.cost:.2f} m")
pheromone = contours_figure(colony.task, grid, found, colony.robot)

# %%
# The drive
# ---------
# The option `shortcut`, which the paper does not have, cuts the loops out of each tour.

result = run(
    Scenario.of("u-trap", "pfaco", options={"ants": 200, "shortcut": True}, seed=1)
)
print(f"pfaco with shortcut: {result.plan.cost:.2f} m")
print(result.outcome.value)
film(result.rollout, "valley.mp4", camera="top", size=(600, 500), speed=4)
