"""Independent computation of a drive's minimum clearance, without code of the certificate.

It reads the world's file and the robot's file as plain YAML, not through antdrive, and the log's poses and speeds. The
footprint becomes a cloud of points: its outline every 5 mm and its inside. Between two rows the pose follows the arc of
the measured twist. Movers are moved step by step. Apart from the arc, the result is never below the true clearance and
exceeds it by at most 0.1 mm, because outline points are 5 mm apart.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

Array = npt.NDArray[np.float64]

SPACING = 0.005  # of the points of the footprint [m]
SUBSTEPS = 8  # poses looked at from one row to the next
PAIRS = 20_000  # of a row and an obstacle that are looked at in one go


class Least(NamedTuple):
    """The least clearances that were found [m].

    Attributes:
        rows: at the logged poses
        between: at these and on the arcs between them
        t: when the least of all was found [s]
        near: what was nearest then
    """

    rows: float
    between: float
    t: float
    near: str


def cloud(footprint: Mapping[str, Any]) -> tuple[Array, Array]:
    """Points (P, 2) on the outline of a footprint, as in a robot's file, and points inside it [m]."""
    if "polygon" in footprint:
        return _polygon_cloud(np.array(footprint["polygon"], dtype=np.float64))
    if footprint.get("centre"):
        edge, inside = cloud({key: value for key, value in footprint.items() if key != "centre"})
        return edge + footprint["centre"], inside + footprint["centre"]
    if "radius" in footprint:
        r = float(footprint["radius"])
        turn = np.linspace(0.0, 2 * math.pi, math.ceil(2 * math.pi * r / SPACING), endpoint=False)
        edge = r * np.column_stack([np.cos(turn), np.sin(turn)])
        half_x = half_y = r
    else:
        half_x, half_y = float(footprint["length"]) / 2, float(footprint["width"]) / 2
        x = np.linspace(-half_x, half_x, 1 + math.ceil(2 * half_x / SPACING))
        y = np.linspace(-half_y, half_y, 1 + math.ceil(2 * half_y / SPACING))
        sides = [(x, np.full_like(x, side * half_y)) for side in (-1, 1)]
        sides += [(np.full_like(y, side * half_x), y) for side in (-1, 1)]
        edge = np.concatenate([np.column_stack(side) for side in sides])
    lattice = np.stack(np.meshgrid(np.arange(-half_x, half_x, SPACING), np.arange(-half_y, half_y, SPACING)), axis=-1)
    inside = lattice.reshape(-1, 2)
    if "radius" in footprint:
        inside = inside[np.hypot(*inside.T) < half_x]
    return edge, inside


def _polygon_cloud(corners: Array) -> tuple[Array, Array]:
    following = np.roll(corners, -1, axis=0)
    counts = 1 + np.ceil(np.hypot(*(following - corners).T) / SPACING).astype(int)
    edge = np.concatenate([np.linspace(a, b, n) for a, b, n in zip(corners, following, counts, strict=True)])
    low, high = corners.min(axis=0), corners.max(axis=0)
    lattice = np.stack(np.meshgrid(*(np.arange(a, b, SPACING) for a, b in zip(low, high, strict=True))), axis=-1)
    inside = lattice.reshape(-1, 2)
    away = inside[None] - corners[:, None]
    sides = (following - corners)[:, :1] * away[..., 1] - (following - corners)[:, 1:] * away[..., 0]
    return edge, inside[(sides > 0).all(axis=0) | (sides < 0).all(axis=0)]


def along_arcs(pose: Array, twist: Array, hz: int) -> Iterator[tuple[float, Array]]:
    """Yield fractions of a step and the poses (T, 3) at them; the last row has no step."""
    speed, rate = np.vstack([twist[1:], np.zeros((1, 2))]).T / hz
    for share in np.arange(SUBSTEPS) / SUBSTEPS:
        turned = rate * share
        chord = speed * share * np.sinc(turned / 2 / math.pi)
        heading = pose[:, 2] + turned / 2
        yield (
            float(share),
            np.column_stack(
                [pose[:, 0] + chord * np.cos(heading), pose[:, 1] + chord * np.sin(heading), pose[:, 2] + turned]
            ),
        )


def track(mover: Mapping[str, Any], bounds: Array, t: Array) -> Array:
    """Where a mover of a world's file is at increasing times, (T, 2) [m].

    Raises:
        ValueError: it neither cruises nor goes to and fro along keyframes.
    """
    phase = float(mover.get("phase", 0.0))
    if "velocity" in mover:
        return np.column_stack([
            _bouncing(float(x), float(v), low + mover["radius"], high - mover["radius"], t + phase)
            for x, v, low, high in zip(mover["position"], mover["velocity"], bounds[:2], bounds[2:], strict=True)
        ])  # fmt: skip
    if mover.get("loop", "pingpong") != "pingpong" or mover.get("interpolation", "linear") != "linear":
        raise ValueError("the second audit knows movers that cruise, or go to and fro along straight lines")
    if "keyframes" not in mover:
        raise ValueError("the second audit knows no wanderers")
    frames = np.array(mover["keyframes"], dtype=np.float64)
    knots, places = [frames[0, 0]], [frames[0, 1:]]
    order = list(range(len(frames)))
    while knots[-1] <= t[-1] + phase:
        for before, after in itertools.pairwise(order):
            knots.append(knots[-1] + abs(frames[after, 0] - frames[before, 0]))
            places.append(frames[after, 1:])
        order.reverse()
    return np.column_stack([np.interp(t + phase, knots, column) for column in np.array(places).T])


def _bouncing(x: float, v: float, low: float, high: float, t: Array) -> Array:
    """Return a coordinate that bounces between walls."""
    times, places, now = [0.0], [x], 0.0
    while now <= t[-1] and v:
        wall = high if v > 0 else low
        now += (wall - places[-1]) / v
        times.append(now)
        places.append(wall)
        v = -v
    return np.interp(t, times, places) if len(times) > 1 else np.full(len(t), x)


def least_clearance(
    world: Mapping[str, Any], footprint: Mapping[str, Any], pose: Array, twist: Array, hz: int
) -> Least:
    """Return the least distance of a footprint from every cylinder, mover and wall during a drive.

    Args:
        world: what the world's file says
        footprint: what the robot's file says of its footprint
        pose: logged poses (T, 3) [m, m, rad]
        twist: measured speeds (T, 2) [m/s, rad/s]
        hz: rows per second [Hz]
    """
    edge, inside = cloud(footprint)
    reach = float(np.hypot(*edge.T).max())
    tree = cKDTree(np.concatenate([edge, inside]))
    bounds = np.array(world["bounds"], dtype=np.float64)
    discs = np.array([[o["x"], o["y"], o["radius"]] for o in world.get("obstacles") or []], dtype=np.float64)
    discs = discs.reshape(-1, 3)
    movers = world.get("movers") or []
    t = np.arange(len(pose)) / hz
    radii = np.concatenate([discs[:, 2], [m["radius"] for m in movers]])
    names = [f"obstacles[{i}]" for i in range(len(discs))] + [f"movers[{i}]" for i in range(len(movers))]
    moving = [[track(m, bounds, t + share / SUBSTEPS / hz) for m in movers] for share in range(SUBSTEPS)]
    # No point of the robot, and no mover, gets farther in one step than this.
    step = float(np.abs(twist[:, 0]).max() + reach * np.abs(twist[:, 1]).max()) / hz
    step += max((float(np.hypot(*np.diff(place, axis=0).T).max(initial=0.0)) for place in moving[0]), default=0.0)
    away = np.empty((len(pose), len(radii)))
    away[:, : len(discs)] = np.hypot(pose[:, :1] - discs[:, 0], pose[:, 1:2] - discs[:, 1])
    for m, place in enumerate(moving[0]):
        away[:, len(discs) + m] = np.hypot(*(pose[:, :2] - place).T)
    lower = away - radii - reach - step
    arcs = [poses for _, poses in along_arcs(pose, twist, hz)]
    rows, between, at, near = _walls(edge, reach + step, bounds, arcs, hz)
    order = np.argsort(lower, axis=None)
    for begin in range(0, len(order), PAIRS):
        r, k = np.unravel_index(order[begin : begin + PAIRS], lower.shape)
        wanted = lower[r, k] < min(rows, between)
        r, k = r[wanted], k[wanted]
        if not len(r):
            break
        for sub, poses in enumerate(arcs):
            if sub == 1:  # movers go on after the last row, but the drive does not
                r, k = r[r < len(pose) - 1], k[r < len(pose) - 1]
                if not len(r):
                    break
            here = poses[r]
            centre = np.empty((len(r), 2))
            still = k < len(discs)
            centre[still] = discs[k[still], :2]
            for m in range(len(movers)):
                mine = k == len(discs) + m
                centre[mine] = moving[sub][m][r[mine]]
            dx, dy = (centre - here[:, :2]).T
            cos, sin = np.cos(here[:, 2]), np.sin(here[:, 2])
            gap = tree.query(np.column_stack([cos * dx + sin * dy, cos * dy - sin * dx]))[0] - radii[k]
            least = int(gap.argmin())
            if sub == 0:
                rows = min(rows, float(gap[least]))
            if gap[least] < between:
                between, at, near = float(gap[least]), float(t[r[least]] + sub / SUBSTEPS / hz), names[k[least]]
    return Least(rows, between, at, near)


def _walls(edge: Array, reach: float, bounds: Array, arcs: list[Array], hz: int) -> tuple[float, float, float, str]:
    """Return the least distance from a wall at and between rows [m], its time [s], and the wall's name."""
    rows = between = math.inf
    at, near = 0.0, ""
    xmin, ymin, xmax, ymax = bounds
    x, y = arcs[0][:, 0], arcs[0][:, 1]
    lower = np.minimum.reduce([x - xmin, y - ymin, xmax - x, ymax - y]) - reach
    candidates = np.argsort(lower)
    for begin in range(0, len(candidates), 500):
        some = candidates[begin : begin + 500]
        some = some[lower[some] < min(rows, between)]
        if not len(some):
            break
        for sub, poses in enumerate(arcs):
            x, y, yaw = poses[some].T[..., None]
            px = x + np.cos(yaw) * edge[:, 0] - np.sin(yaw) * edge[:, 1]
            py = y + np.sin(yaw) * edge[:, 0] + np.cos(yaw) * edge[:, 1]
            gaps = np.stack([(px - xmin).min(1), (xmax - px).min(1), (py - ymin).min(1), (ymax - py).min(1)])
            wall, row = np.unravel_index(int(gaps.argmin()), gaps.shape)
            least = float(gaps[wall, row])
            if sub == 0:
                rows = min(rows, least)
            if least < between:
                names = ("left wall", "right wall", "bottom wall", "top wall")
                between, at, near = least, float(some[row] / hz + sub / SUBSTEPS / hz), names[wall]
    return rows, between, at, near
