"""
Ants of a thesis, and their drive
=================================

Han's ants choose the next cell by pheromone and by the direction of the goal (Han 2007, §4.2). Here a hundred of them
search his map with fourteen obstacles, and a robot drives what they found.
"""

from antdrive import Scenario, film, plan, run
from antdrive.views import plan_figure

scenario = Scenario.of(
    "han2007-aco", "aco-han-elite", options={"ants": 100}, seed=4
)

# %%
# The plan
# --------
# The colony's pheromone lies under the path that it found; the chart shows the best length by iteration. Ants walk from
# cell to cell, so the path is a staircase.

grid, found = plan(scenario)
print(f"{found.cost:.2f} m over {len(found.cells)} cells")
plan_found = plan_figure(scenario.task, grid, found, scenario.robot)

# %%
# The drive
# ---------
# Before it is driven, the plan is pulled taut within its corridor and moved away from obstacles where there is room.

result = run(scenario)
print(result.outcome.value)
print(
    f"{result.metrics['driven_length_m']:.2f} m driven in {result.metrics['duration_s']:.1f} s"
)
print(
    f"never nearer than {result.certificate.bound:.3f} m to anything, proved from the log"
)
film(result.rollout, "ants.mp4", camera="top", size=(640, 480), speed=6)
