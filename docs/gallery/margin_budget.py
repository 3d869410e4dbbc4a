"""
A margin's budget
=================

Planning keeps 6 cm free around the disc that holds the robot. Where did they go? The drive's log has the planned
route, the true pose and the pose in which the robot believed, so every loss has a cause.
"""

from antdrive import Scenario, film, run
from antdrive.sim.log.margin import CAUSES, budget
from matplotlib.figure import Figure

result = run(
    Scenario.of("slalom", "astar", margin=0.06, smoothing="taut", noise=3.0, seed=3)
)
print(result.outcome.value)
spent = budget(result.rollout)
print(
    f"{100 * spent.margin:.0f} cm planned, {100 * spent.left:.1f} cm left at t = {spent.t:.1f} s"
)

# %%
# Cause by cause
# --------------
# Blue is what a cause took where it took most. Orange is what it took at the place where least was left, negative where
# it helped; these add up to the difference between what was planned and what was left.

figure = Figure(figsize=(7.2, 3.4), layout="constrained")
axes = figure.add_subplot(label="budget")
rows = range(len(CAUSES))
axes.barh(
    [row - 0.2 for row in rows],
    [100 * one.metres for one in spent.contributions],
    0.36,
    label="at most",
)
axes.barh(
    [row + 0.2 for row in rows],
    [100 * one.at_tightest for one in spent.contributions],
    0.36,
    label="at the tightest place",
)
axes.axvline(100 * spent.margin, color="black", lw=1, ls="--", label="planned")
axes.set(yticks=list(rows), yticklabels=list(CAUSES), xlabel="loss of margin [cm]")
axes.invert_yaxis()
_ = axes.legend(frameon=False)

# %%
# The drive
# ---------
# The robot believes its wheels and a pose that is fixed now and then; both are wrong by three times what its file documents.

film(
    result.rollout, "budget.mp4", camera="follow", size=(480, 360), fps=20, speed=2
)
