"""Map of a world with driven path, planner's field and legend."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.collections import PathCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.patches import Circle, Patch, Polygon, Rectangle
from matplotlib.path import Path

from antdrive.base.types import Floats, Point
from antdrive.sim.log.rollout import Rollout
from antdrive.views import colours
from antdrive.views.colours import Colour, hexed, shown_field
from antdrive.views.figures.canvas import colour_bar, frame_map, legend_above, thinned
from antdrive.views.scene import Scene, contact_point, decisive_row
from antdrive.worlds.coverage import share_of

if TYPE_CHECKING:
    from antdrive.worlds.coverage import Coverage
    from antdrive.worlds.grid import Grid


FIELD = LinearSegmentedColormap.from_list("field", [hexed(stop) for stop in colours.FIELD_STOPS])
SWEPT = 0.02  # motion of the farthest corner between two drawn footprints [m]
LABEL = (0.5, 0.17)  # width and height of a door's label [inches]; doors within it of a labelled one have none
MANY = 1000  # cylinders; larger numbers are drawn without edges


def draw_map(axes: Any, scene: Scene, *, floor: bool = True) -> None:
    """Draw walls, obstacles, no-go area, movers with their tracks, start and goal."""
    x0, y0, x1, y1 = scene.bounds
    frame_map(axes, scene.bounds)
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.set_aspect("equal", adjustable="box")
    axes.spines[:].set_visible(False)
    axes.grid(floor)
    inside = Rectangle((x0, y0), x1 - x0, y1 - y0, fill=False, ec=hexed(colours.KERB), lw=3.0, zorder=4.5)
    axes.add_patch(inside)
    known = scene.obstacles[~scene.unseen]
    if scene.has_no_go_area:
        # One opaque layer: overlaps of transparent zones would look darker.
        zones = _circles(known[:, :2], known[:, 2] + scene.inflate)
        i = scene.inflate
        zones_walls = [
            _corners(*corners)
            for corners in ((x0, y0, x0 + i, y1), (x1 - i, y0, x1, y1), (x0, y0, x1, y0 + i), (x0, y1 - i, x1, y1))
        ]
        layer = PathCollection(
            [*zones, *zones_walls], facecolor=_pale(colours.ZONE, 0.22), edgecolor="none", zorder=1.2
        )
        if not floor:
            layer.set(facecolor="none", edgecolor=hexed(colours.ZONE), linewidth=0.6, alpha=0.8)
        axes.add_collection(layer)
        layer.set_clip_path(inside)
    for chosen, colour in ((known, colours.OBSTACLE), (scene.obstacles[scene.unseen], colours.UNSEEN)):
        edge = 0.4 if len(chosen) <= MANY else 0.0  # thousands of white edges would hide the obstacles
        circles = _circles(chosen[:, :2], chosen[:, 2])
        bodies = PathCollection(circles, facecolor=hexed(colour), edgecolor="white", linewidth=edge, zorder=3)
        axes.add_collection(bodies)
        bodies.set_clip_path(inside)
    for piece in scene.tracks:
        axes.plot(*piece.T, color=hexed(colours.MOVER), lw=1.0, alpha=0.45, zorder=2.5, solid_capstyle="round")
    for (x, y), radius in zip(scene.movers, scene.mover_radii, strict=True):
        body = Circle((x, y), radius, fc=hexed(colours.MOVER), ec="white", lw=0.6, alpha=0.85, zorder=3.5)
        axes.add_patch(body)
        body.set_clip_path(inside)
    pale_goal = (*(channel / 255 for channel in colours.GOAL), 0.18)
    axes.add_patch(Circle(scene.goal, scene.goal_tolerance, fc=pale_goal, ec=hexed(colours.GOAL), lw=1.4, zorder=4))
    axes.plot(*scene.goal, marker="+", ms=7, mew=1.4, color=hexed(colours.GOAL), zorder=7)
    _draw_robot(axes, scene, scene.start, colours.START, 4.0)


#: Colours of floor and doors, and markers of doors, by the shape that gets there: the first, the second, none.
REACHED = ((colours.GOOD, colours.GOOD, "o"), (colours.START, colours.START, "D"))
MISSED = (colours.DOUBT, colours.BAD, "X")


def draw_coverage(axes: Any, covered: Sequence[Coverage], scale: float) -> list[Any]:
    """Draw the reached floor, the rooms not reached and the doors with their widths; return the legend's handles.

    Args:
        axes: the map
        covered: what the robot reaches, on the same cells: by its disc, and by its footprint where plans keep that clear
        scale: inches per metre of the map
    """
    last, count = covered[-1], len(covered)
    shapes = [" by its disc", " only by its footprint"] if count > 1 else [""]
    reached = [*(f"reached{shape}" for shape in shapes), "not reached"]
    areas = np.select([~last.floor, *(each.reached for each in covered)], [-1, *range(count)], count)
    passed = np.array([[door.passed for door in each.doors] for each in covered] + [[True] * len(last.doors)])
    firsts = passed.argmax(axis=0)
    paint = np.zeros((*areas.shape, 4))
    handles: list[Any] = []
    markers: list[Any] = []
    labelled: list[Point] = []
    for k, (colour, door_colour, marker) in enumerate((*REACHED[:count], MISSED)):
        here = areas == k
        paint[here] = (*(channel / 255 for channel in colour), 0.34)
        label = f"{reached[k]}: {share_of(here, last.floor):.0%} of the floor"
        if here.any():
            handles.append(Patch(facecolor=hexed(colour), alpha=0.34, label=label))
        doors = [door for door, first in zip(last.doors, firsts.tolist(), strict=True) if first == k]
        label = f"door passed{shapes[k]}" if k < count else "door not passed"
        style = {"color": hexed(door_colour), "ms": 6, "mec": "white", "mew": 0.6, "ls": "none", "zorder": 9}
        markers += axes.plot(*np.array([door.at for door in doors]).T, marker, label=label, **style) if doors else []
        for door in doors:
            if any((np.abs(np.subtract(door.at, other)) * scale < LABEL).all() for other in labelled):
                continue
            labelled.append(door.at)
            place: dict[str, Any] = {"xytext": (5, 4), "textcoords": "offset points", "zorder": 8}
            note = axes.annotate(f"{door.width:.2f} m", door.at, fontsize=7.5, color=hexed(door_colour), **place)
            note.set(bbox={"fc": "white", "ec": "none", "alpha": 0.8, "pad": 0.8})
    x0, y0 = (np.asarray(last.by.origin) - last.by.cell / 2).tolist()
    rows, cols = (side * last.by.cell for side in areas.shape)
    axes.imshow(paint, origin="lower", extent=(x0, x0 + cols, y0, y0 + rows), interpolation="nearest", zorder=1.5)
    return [*handles, *markers]


def _pale(colour: Colour, strength: float) -> tuple[float, ...]:
    """Return a colour mixed with white, 0 to 1."""
    return tuple(1 - strength * (1 - channel / 255) for channel in colour)


def _circles(centres: Floats, radii: Floats) -> list[Path]:
    """Return circles as paths, ten times as fast as matplotlib's own circles."""
    unit = Path.unit_circle()
    points, codes = np.asarray(unit.vertices), unit.codes
    return [Path(points * r + centre, codes) for centre, r in zip(centres, radii.tolist(), strict=True)]


def _corners(x0: float, y0: float, x1: float, y1: float) -> Path:
    """Return a rectangle as a path."""
    return Path([(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)], closed=True)


def _draw_robot(axes: Any, scene: Scene, pose: tuple[float, float, float], colour: Any, zorder: float) -> None:
    """Draw the footprint's outline at a pose, with a line from its centre along the heading."""
    x, y, yaw = pose
    foot = scene.robot.footprint
    turn = _rotation(yaw)
    ahead = turn @ [foot.reach(0.0) if foot.corners else foot.half_length + foot.rounding, 0.0]
    style: dict[str, Any] = {"fc": (1, 1, 1, 0.55), "ec": hexed(colour), "lw": 1.3, "zorder": zorder}
    if foot.is_disc:
        axes.add_patch(Circle((x, y), foot.rounding, **style))
    else:
        axes.add_patch(Polygon(np.array(foot.outline()) @ turn.T + [x, y], **style))
    axes.plot([x, x + ahead[0]], [y, y + ahead[1]], color=hexed(colour), lw=1.3, zorder=zorder)


def _rotation(yaw: float) -> Floats:
    return np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])


def _draw_swept(axes: Any, scene: Scene, rollout: Rollout) -> list[Any]:
    """Draw the area that the footprint swept where plans keep it clear, and return its legend handle."""
    if not scene.outlined:
        return []
    pose, outline = rollout.pose, np.array(scene.robot.footprint.outline())
    moved = np.hypot(*np.diff(pose[:, :2], axis=0).T) + scene.robot.footprint.radius * np.abs(np.diff(pose[:, 2]))
    whole = np.floor(np.concatenate([[0.0], np.cumsum(moved)]) / SWEPT)
    rows = np.unique(whole, return_index=True)[1]
    bodies = [Path(outline @ _rotation(yaw).T + [x, y], closed=False) for x, y, yaw in pose[rows].tolist()]
    pale = _pale(colours.SHELL, 0.25)
    axes.add_collection(PathCollection(bodies, facecolor=pale, edgecolor="none", zorder=1.4))
    return [Patch(fc=pale, label="area swept")]


def draw_driven(axes: Any, scene: Scene, rollout: Rollout, cells: Floats | None) -> None:
    """Draw the route, the driven path, the first contact, and the robot there and at the end."""
    handles: list[Any] = []
    if cells is not None and len(cells):
        handles += axes.plot(*cells.T, ".", ms=2.6, color=hexed(colours.MUTED), label="planned cells", zorder=4.6)
    if len(rollout.route) > 1:
        style = {"ls": (0, (4, 2.5)), "lw": 1.0, "color": hexed(colours.ROUTE)}
        handles += axes.plot(*rollout.route.T, **style, label="route" if scene.mapped else "initial route", zorder=4.8)
        for k, (_, line) in enumerate(rollout.legs()[1:]):
            drawn = axes.plot(*line.T, **{**style, "lw": 0.7, "alpha": 0.45}, label="new routes", zorder=4.7)
            handles += drawn if k == 0 else []
    if len(rollout.t) > 1:
        handles += _draw_swept(axes, scene, rollout)
        style = {"color": hexed(colours.SHELL), "lw": 2.0, "label": "driven path", "zorder": 5}
        handles += axes.plot(*rollout.pose[thinned(len(rollout.t)), :2].T, **style)
        for row in {decisive_row(rollout), len(rollout.t) - 1}:
            x, y, yaw = rollout.pose[row].tolist()
            _draw_robot(axes, scene, (x, y, yaw), colours.SHELL, 6)
    if len(rollout.contacts):
        row = min(rollout.first_contact, len(rollout.t) - 1)
        at = contact_point(scene, rollout.pose[row], int(rollout.contacts[0, 1]), rollout.movers[row])
        style = {"ms": 9, "color": hexed(colours.BAD), "mec": "white", "label": "contact", "zorder": 9, "ls": "none"}
        handles += axes.plot(*at, "X", **style)
    draw_legend(axes, handles, scene)


def draw_legend(axes: Any, handles: list[Any], scene: Scene, **place: Any) -> None:
    """Draw the map's legend above its upper left corner: `handles`, obstacles, movers and no-go area."""
    known = [Patch(fc=hexed(colours.OBSTACLE), label="obstacle" if scene.mapped else "obstacle, not on a map")]
    if scene.unseen.any():
        known.append(Patch(fc=hexed(colours.UNSEEN), label=scene.unseen_label))
    if scene.mover_radii:
        known.append(Patch(fc=hexed(colours.MOVER), label=f"mover at {scene.movers_at:.1f} s"))
    if scene.has_no_go_area:
        known.append(Patch(fc=_pale(colours.ZONE, 0.22), ec=hexed(colours.ZONE), lw=0.5, label=scene.no_go_label))
    legend_above(axes, [*handles, *known], handlelength=1.6, **place)


def draw_field(figure: Any, axes: Any, grid: Grid, field: Floats, name: str) -> bool:
    """Draw a planner's field (R, C) as coloured cells below the map; return False, without a drawing, if it is constant."""
    found = shown_field(grid, field)
    if found is None:
        return False
    values, low, high = found
    (rows, cols), (x, y), half = grid.shape, grid.origin, grid.cell / 2
    extent = (x - half, x + (cols - 0.5) * grid.cell, y - half, y + (rows - 0.5) * grid.cell)
    scale: dict[str, Any] = {"cmap": FIELD, "vmin": low, "vmax": high, "interpolation": "nearest"}
    image = axes.imshow(values, origin="lower", extent=extent, zorder=0.5, **scale)
    colour_bar(figure, image, axes, name)
    return True
