"""
Tasks in an office
==================

A floor plan is a grid of free and blocked cells, as in map_server's files. It becomes a world of cylinders that cover every
blocked cell next to free ground. One world serves many tasks.
"""

from dataclasses import replace

import numpy as np
from antdrive import Scenario, run
from antdrive.views import comparison_figure, write_view
from antdrive.worlds import CellMap, map_task

# %%
# The floor plan
# --------------
# Six rooms of 4 × 4 m on both sides of a corridor, each with a door of 1 m and a table. A pixel is 0.1 m.

free = np.zeros((106, 126), dtype=bool)  # (rows along y, columns along x)
free[43:63, 1:125] = True  # the corridor
for left in (1, 43, 85):
    for low, door in ((1, 41), (65, 63)):
        free[low : low + 40, left : left + 40] = True  # a room
        free[door : door + 2, left + 15 : left + 25] = True  # its door
        free[low + 14 : low + 26, left + 26 : left + 36] = False  # its table
office = map_task(
    CellMap(free, 0.1), (1.0, 5.3, 0.0), (11.6, 5.3), name="office", cell=0.2
)
print(f"{len(office.world.obstacles)} cylinders")

# %%
# Three tasks
# -----------

errands = {
    "end of the corridor": office.goal,
    "room, upper right": (9.4, 9.0),
    "room, lower middle": (5.2, 1.2),
}
runs = {
    name: run(Scenario.of(replace(office, goal=goal), "astar", "turtlebot", seed=1))
    for name, goal in errands.items()
}
for name, result in runs.items():
    print(
        f"{name}: {result.outcome.value}, clearance at least {result.certificate.bound:.2f} m"
    )
drives = comparison_figure({name: result.rollout for name, result in runs.items()})

# %%
# One drive
# ---------

# sphinx_gallery_thumbnail_number = -1

write_view(runs["room, upper right"].rollout, "office.html")
