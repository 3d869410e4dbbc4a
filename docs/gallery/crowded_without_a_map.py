"""
The same corridor, without a map
================================

The world of :doc:`crowded_with_a_map`, and nothing but a lidar, odometry and the goal. The robot plans through ground
that it has not seen as if it were free, plans anew when a scan shows otherwise, and never drives faster than it could
stop on ground that it has seen.
"""

import numpy as np
from antdrive import Scenario, film, run
from antdrive.views import sight_figure
from antdrive.worlds import barn

world = barn(np.random.default_rng(3), fill=0.27)
scenario = Scenario.of(
    world, "astar", "jackal", seed=3, map="none", localisation="matching", noise=1
)
result = run(scenario)
print(result.outcome.value)
print(
    f"{result.metrics['duration_s']:.1f} s, {result.metrics['replans']:.0f} new routes on the way"
)
film(result.rollout, "crowded-lidar.mp4", camera="top", size=(480, 360), speed=3)

# %%
# What it had seen
# ----------------
# On the left the map that the robot had at the end, made of the scans in its log. On the right how its size grew, and
# from how far it first saw the obstacles that it later came nearest to.

seen = sight_figure(result.rollout)
