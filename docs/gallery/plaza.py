"""
Across a plaza, among six movers
================================

Movers follow keyframes, bounce between walls, or wander. The robot sees where they are and how fast they go, and nothing
of what they are about to do. Local avoidance looks ahead sixty times a second; a new route is planned when the present
one is obstructed.
"""

from antdrive import Scenario, film, run
from antdrive.views import overview

result = run(Scenario.of("plaza-moving", "dstar-lite"))
print(result.outcome.value)
print(
    f"{result.metrics['replans']:.0f} new routes, avoided movers for {result.metrics['avoiding_s']:.1f} s"
)
film(result.rollout, "plaza.mp4", size=(640, 480), speed=2)

# %%
# Clearance and speed over time
# -----------------------------
# Where the speed falls and the strip below says *avoid*, a mover was in the way.

drive = overview(result.rollout)
