"""
A crowded corridor, with a map
==============================

The generator ``barn`` makes worlds like those of the BARN challenge: a cellular automaton fills a corridor with small
cylinders and leaves a passage for a Jackal. Here the robot has the map.
"""

import numpy as np
from antdrive import Scenario, run
from antdrive.views import overview, write_view
from antdrive.worlds import barn

world = barn(np.random.default_rng(3), fill=0.27)
result = run(Scenario.of(world, "astar", "jackal", seed=3))
print(result.outcome.value)
print(
    f"{result.metrics['duration_s']:.1f} s, clearance at least {result.certificate.bound:.3f} m"
)
write_view(result.rollout, "crowded-map.html")

# %%
# Speed limits
# ------------
# The lowest strip shows the speed-limiting rule over time. Between cylinders it is the clearance.

drive = overview(result.rollout)
