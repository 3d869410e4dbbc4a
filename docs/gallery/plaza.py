"""
A plaza with six movers
=======================

Movers follow keyframes, bounce between walls, or wander. The robot is given their ground-truth positions and velocities,
but not their future motions. Local avoidance runs at 60 Hz, and the robot re-plans when a mover obstructs its route.
"""

from antdrive import Scenario, film, run
from antdrive.views import overview

result = run(Scenario.of("plaza-moving", "dstar-lite"))
print(result.outcome.value)
print(
    f"{result.metrics['replans']:.0f} new routes, avoided movers for {result.metrics['avoiding_s']:.1f} s"
)
film(result.rollout, "plaza.mp4", camera="oblique", size=(640, 480), speed=2)

# %%
# Clearance and speed over time
# -----------------------------
# The speed drops where the strip below says *avoid*: a mover was in the way.

drive = overview(result.rollout)
