"""
Ants in a potential field (Lee 2008)
====================================

A potential field attracts the robot to the goal and repels it from obstacles. Gradient descent is fast, but ends in the
first local minimum. The ants of Lee, Kim, Choi and Lee (2008) climb a field that rises away from the start.
"""

from antdrive import Scenario, plan, run
from antdrive.views import plan_figure, write_view

# %%
# A local minimum
# ---------------
# The goal lies behind a U that opens towards the start. The descent ends inside the U, where all directions lead uphill.

descent = Scenario.of("u-trap", "apf")
grid, stuck = plan(descent)
print(f"apf: {stuck.status.value}")
valley = plan_figure(descent.task, grid, stuck, descent.robot)

# %%
# Ants escape
# -----------
# Ants choose at random by pheromone and field, so some leave the U. The field rises on past the goal, so ants wander there.
# Their pheromone covers the map.

colony = Scenario.of("u-trap", "pfaco", options={"ants": 200}, seed=1)
grid, found = plan(colony)
print(f"pfaco: {found.cost:.2f} m")
pheromone = plan_figure(colony.task, grid, found, colony.robot)

# %%
# The drive
# ---------
# The option `shortcut`, an addition to the paper, cuts a tour short where it passes next to an earlier part of itself.

result = run(
    Scenario.of("u-trap", "pfaco", options={"ants": 200, "shortcut": True}, seed=1)
)
print(f"pfaco with shortcut: {result.plan.cost:.2f} m")
print(result.outcome.value)
write_view(result.rollout, "valley.html")
