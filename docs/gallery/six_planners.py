"""
Six planners in one world
=========================

Six planners drive the same world with the same robot and controller. Without smoothing, the robot drives each planner's path
as planned.
"""

from antdrive import Scenario, run
from antdrive.views import comparison_figure, write_view

names = ["astar", "tangent", "as", "mmas", "aco-han", "ants"]
runs = {
    name: run(Scenario.of("slalom", name, smoothing="none", seed=1))
    for name in names
}
for name, result in runs.items():
    length, time = result.metrics["driven_length_m"], result.metrics["duration_s"]
    print(f"{name:>8}: {length:5.2f} m in {time:4.1f} s, {result.outcome.value}")

# %%
# Their drives on one map
# -----------------------

drives = comparison_figure(
    {name: result.rollout for name, result in runs.items() if result.rollout}
)

# %%
# Four of them on one clock
# -------------------------

four = {name: runs[name].rollout for name in ("astar", "tangent", "mmas", "ants")}
write_view(four, "six-planners.html")
