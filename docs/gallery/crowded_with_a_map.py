"""
A crowded corridor, with its map
================================

The generator ``barn`` makes worlds like those of the BARN challenge: a corridor of small cylinders, grown by a cellular
automaton, with room for a Jackal to pass. Here the robot knows the world.
"""

import numpy as np
from antdrive import Scenario, film, run
from antdrive.views import overview
from antdrive.worlds import barn

world = barn(np.random.default_rng(3), fill=0.27)
result = run(Scenario.of(world, "astar", "jackal", seed=3))
print(result.outcome.value)
print(
    f"{result.metrics['duration_s']:.1f} s, clearance at least {result.certificate.bound:.3f} m"
)
film(result.rollout, "crowded-map.mp4", size=(640, 480), speed=2)

# %%
# What limited its speed
# ----------------------
# Colours in the lowest strip name the rule that held the robot back at each moment. Between cylinders that is the clearance.

drive = overview(result.rollout)
