"""
A collision explained
=====================

A check that cannot fail is worth nothing. So here is a cylinder that neither the planner nor the controller knows of.
"""

from antdrive import Disc, Scenario, film, run
from antdrive.views import certificate_figure

hidden = Disc(3.0, 3.0, 0.2)
result = run(Scenario.of("empty", "astar", unseen=(hidden,)))
print(result.outcome.value)
film(result.rollout, "collision.mp4", size=(640, 480))

# %%
# What the log says
# -----------------
# Physics reports a contact, and the distance in closed form reaches zero at the same step. The certificate names both.

for line in result.certificate.problems:
    print(line)
readings = certificate_figure(result.rollout, result.certificate)

# %%
# The same place with a lidar
# ---------------------------
# Without a map the robot believes only what it sees. It finds the cylinder and passes it.

passed = run(Scenario.of("empty", "astar", unseen=(hidden,), map="none"))
print(passed.outcome.value)
film(passed.rollout, "passed.mp4", camera="top", size=(720, 540), speed=3)
