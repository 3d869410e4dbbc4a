"""Top view of a robot: footprint and collision geometry."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch, Polygon, Rectangle

from antdrive.base.types import Floats
from antdrive.robots.card import footprint_text
from antdrive.robots.importing.hull import convex_hull
from antdrive.robots.spec import RobotSpec
from antdrive.views.colours import GOAL, INK, MUTED, ROUTE, hexed
from antdrive.views.figures.canvas import sheet

WIDTH = 5.6  # of the figure [inches]


def robot_figure(
    robot: RobotSpec, path: str | Path | None = None, *, pieces: Sequence[Floats] = (), above: Sequence[Floats] = ()
) -> Figure:
    """Draw a robot from above, heading right; coordinates are relative to the axle's centre [m].

    `pieces` holds the points (N, 2) [m] of the collision geometry in the footprint, `above` those beyond its height limit.
    """
    outline = np.array(robot.footprint.outline(48))
    everything = np.vstack([outline, *pieces, *above])
    low, high = everything.min(axis=0) - 0.15 * robot.radius, everything.max(axis=0) + 0.15 * robot.radius
    low, high = np.minimum(low, -1.08 * robot.radius), np.maximum(high, 1.08 * robot.radius)
    wide, tall = high - low
    with sheet(path, (WIDTH, float(np.clip(WIDTH * tall / wide, 3.0, 9.0)) + 0.9)) as figure:
        axes = figure.add_subplot(label="map")
        handles = _draw_pieces(axes, pieces, above)
        handles.append(axes.add_patch(Polygon(outline, fill=False, ec=hexed(ROUTE), lw=2.0, label="footprint")))
        around = Circle((0, 0), robot.radius, fill=False, ec=hexed(MUTED), lw=1.0, ls="--", label="planning disc")
        handles.append(axes.add_patch(around))
        thick = robot.wheel_thickness
        for side in (1, -1):
            corner = (-robot.wheel_radius, side * robot.track / 2 - thick / 2)
            axes.add_patch(Rectangle(corner, 2 * robot.wheel_radius, thick, fc=hexed(INK), ec="none"))
        axes.plot([0, 0], [-robot.track / 2, robot.track / 2], color=hexed(INK), lw=1.0)
        tip = robot.footprint.reach(0.0)
        axes.annotate("", (tip, 0), (0, 0), arrowprops={"arrowstyle": "-|>", "color": hexed(GOAL), "lw": 1.6})
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        axes.set_xlabel("ahead of the axle [m]")
        axes.set_ylabel("to the left [m]")
        title = f"{robot.name}: {footprint_text(robot.footprint)}".replace("; ", "\n")
        axes.set_title(title, fontsize=9, loc="left", wrap=True)
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
    return figure


def _draw_pieces(axes: Any, pieces: Sequence[Floats], above: Sequence[Floats]) -> list[Patch]:
    """Draw the outline of each piece and return one patch per kind for the legend."""
    handles: list[Patch] = []
    kinds: tuple[tuple[Sequence[Floats], dict[str, Any], str], ...] = (
        (above, {"fc": "none", "ec": hexed(MUTED), "ls": ":", "lw": 1.0}, "collision geometry above"),
        (pieces, {"fc": "#dfe5f2", "ec": "#8a97b3", "lw": 0.8, "alpha": 0.75}, "collision geometry"),
    )
    for group, style, label in kinds:
        for k, points in enumerate(group):
            hull = convex_hull([(float(x), float(y)) for x, y in points])
            patch = axes.add_patch(Polygon(hull, **style, label=label))
            handles += [patch] if k == 0 else []
    return handles
