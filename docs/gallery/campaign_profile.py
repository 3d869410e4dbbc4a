"""
Performance profile of a campaign
=================================

A campaign drives every combination of worlds, planners and seeds. A performance profile (Dolan and Moré 2002) shows for each
planner the fraction of instances that it solves within x times the best planner's value.
"""

import tempfile
from pathlib import Path

import numpy as np
from antdrive import sweep
from antdrive.runs.statistics.success import performance_profiles
from matplotlib.figure import Figure

campaign = {
    "worlds": [{"generate": "forest", "seeds": 6}],
    "planners": ["astar", {"name": "aco-han", "ants": [10, 100]}, "maco"],
    "smoothing": "none",
}
with tempfile.TemporaryDirectory() as folder:
    results = sweep(campaign, Path(folder), jobs=1)
    table = results.table.select(
        ["world", "planner", "certified", "driven_length_m"]
    ).to_pylist()
print(f"{results.size} runs, {results.succeeded} of them certified at the goal")

# %%
# Driven lengths
# --------------
# A curve starts at the fraction of worlds in which the planner's drive was the shortest. Failed runs keep a curve below 1. The
# shortest plan is not always the shortest drive: the robot rounds corners, so of two plans of equal length the one with more
# corners gives the shorter drive.

worlds = sorted({row["world"] for row in table})
planners = list(dict.fromkeys(row["planner"] for row in table))
lengths = {
    (row["world"], row["planner"]): row["driven_length_m"]
    for row in table
    if row["certified"]
}
cost = np.array(
    [
        [lengths.get((world, planner), np.nan) for planner in planners]
        for world in worlds
    ]
)

figure = Figure(figsize=(6.4, 3.8), layout="constrained")
axes = figure.add_subplot(label="profile")
for planner, curve in zip(planners, performance_profiles(cost), strict=True):
    shown = curve.x <= 1.1
    axes.step(
        [1.0, *curve.x[shown], 1.1],
        [0.0, *curve.fraction[shown], curve.fraction[shown].max(initial=0.0)],
        where="post",
        label=planner,
        lw=2,
    )
axes.set(
    xlim=(0.998, 1.1),
    ylim=(0, 1.02),
    xlabel="driven length, relative to the best",
    ylabel="fraction of worlds",
)
_ = axes.legend(frameon=False)

# %%
# ``antdrive report FOLDER -o page.html`` writes a page with profiles, tests and intervals; see :doc:`/how-to/campaigns`.
