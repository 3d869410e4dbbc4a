"""
Margin budget
=============

Planning adds a margin of 6 cm to the robot's radius. The log holds the route, the true pose and the estimated pose, so every
loss of clearance has a cause.
"""

from antdrive import Scenario, run
from antdrive.sim.log.margin import CAUSES, budget
from antdrive.views import write_view
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
# Losses by cause
# ---------------
# Blue: each cause's largest loss. Orange: its loss at the tightest place, negative for a gain. The orange losses add up to the
# difference between planned and remaining margin.

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
# The robot fuses wheel odometry with pose fixes. Both have three times the errors documented in its file.

# sphinx_gallery_thumbnail_number = -1

write_view(result.rollout, "budget.html")
