"""
A collision explained
=====================

The certificate must detect a collision. This cylinder is unknown to planner and controller, so the robot hits it.
"""

from antdrive import Disc, Scenario, run
from antdrive.views import certificate_figure, write_view

hidden = Disc(3.0, 3.0, 0.2)
result = run(Scenario.of("empty", "astar", unseen=(hidden,)))
print(result.outcome.value)
write_view(result.rollout, "gallery-collision.html")

# %%
# The certificate
# ---------------
# Physics reports a contact, and the clearance reaches zero at the same step. The certificate lists both.

for line in result.certificate.problems:
    print(line)
checks = certificate_figure(result.rollout, result.certificate)

# %%
# With a lidar
# ------------
# A mapless robot relies on its lidar. It detects the cylinder and passes it.

passed = run(Scenario.of("empty", "astar", unseen=(hidden,), map="none"))
print(passed.outcome.value)
write_view(passed.rollout, "passed.html")
