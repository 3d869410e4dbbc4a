"""
A plaza with six movers
=======================

Movers follow keyframes, bounce between walls, or wander. The robot is given their ground-truth positions and velocities,
but not their future motions. Local avoidance runs at 60 Hz, and the robot re-plans when a mover obstructs its route.
"""

from antdrive import Scenario, run
from antdrive.views import overview, write_view

result = run(Scenario.of("plaza-moving", "dstar-lite"))
print(result.outcome.value)
print(
    f"{result.metrics['replans']:.0f} new routes, avoided movers for {result.metrics['avoiding_s']:.1f} s"
)
write_view(result.rollout, "gallery-plaza.html")

# %%
# Clearance and speed over time
# -----------------------------
# The speed drops where the strip below says *avoid*: a mover was in the way.

drive = overview(result.rollout)
