"""
A crowded corridor, mapless
===========================

The world of :doc:`crowded_with_a_map`, but the robot has only a lidar, odometry and the goal. It plans through unknown
ground as if it were free (freespace assumption) and re-plans when a scan shows an obstacle. The stopping constraint limits
its speed to what it can stop within known free ground.
"""

import numpy as np
from antdrive import Scenario, run
from antdrive.views import overview, write_view
from antdrive.worlds import barn

world = barn(np.random.default_rng(3), fill=0.27)
scenario = Scenario.of(
    world, "astar", "jackal", seed=3, map="none", localisation="matching", noise=1
)
result = run(scenario)
print(result.outcome.value)
print(
    f"{result.metrics['duration_s']:.1f} s, {result.metrics['replans']:.0f} replans"
)
write_view(result.rollout, "crowded-lidar.html")

# %%
# Route and speed
# ---------------
# Each scan that shows an obstacle on the route gives a new route.

drive = overview(result.rollout)
