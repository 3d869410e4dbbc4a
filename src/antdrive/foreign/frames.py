"""Transforms between coordinate frames over time, interpolated as tf2 does."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from antdrive.base.types import Floats, Ints

Link: TypeAlias = tuple[str, str]  # a frame and its child
ROBOTS = ("base_footprint", "base_link", "base")  # usual names of a robot's frame


@dataclass(frozen=True, eq=False)
class Edge:
    """Recorded transforms of a frame in its parent.

    Attributes:
        stamps: times of the rows (N,) [ns]; none (0,) for a static transform, which no row changes
        received: times of their receipt (N,) [ns]; none (0,) if unknown
        rows: places and quaternions (N, 7): x, y, z [m], x, y, z, w
    """

    stamps: Ints
    received: Ints
    rows: Floats

    @property
    def moves(self) -> bool:
        """Whether the transform changes, or is unknown."""
        return len(self.stamps) > 0 or not len(self.rows)

    def at(self, t: Ints) -> Floats:
        """Return the frames (T or 1, 4, 4) at times within increasing stamps [ns]: linear in place, slerp in turn."""
        if not len(self.stamps):
            return frames_of(self.rows[-1:])
        k = np.clip(np.searchsorted(self.stamps, t, side="right") - 1, 0, len(self.stamps) - 2)
        f = ((t - self.stamps[k]) / (self.stamps[k + 1] - self.stamps[k]))[:, None]
        a, b = self.rows[k], self.rows[k + 1]
        cosine = np.sum(a[:, 3:] * b[:, 3:], axis=1, keepdims=True)
        angle = np.maximum(np.arccos(np.minimum(np.abs(cosine), 1.0)), 1e-9)
        near, far = np.sin((1 - f) * angle), np.copysign(np.sin(f * angle), cosine)
        return frames_of(np.hstack([(1 - f) * a[:, :3] + f * b[:, :3], near * a[:, 3:] + far * b[:, 3:]]))


@dataclass(frozen=True, eq=False)
class Recording:
    """The frames between a map and a robot as a file has them.

    Attributes:
        edges: each frame's name and transforms, and whether they lead upwards, from child to parent
        source: what was used
        notes: what to know of it
    """

    edges: list[tuple[str, Edge, bool]]
    source: dict[str, str]
    notes: Sequence[str] = ()


def chains_to(last: str, links: Collection[Link]) -> dict[str, list[str]]:
    """Return the shortest chain of frames to the last one from each frame that is joined to it, the nearest first."""
    chains, reached = {last: [last]}, [last]
    for frame in reached:
        for there in [*(child for parent, child in links if parent == frame), *(a for a, b in links if b == frame)]:
            if there not in chains:
                chains[there] = [there, *chains[frame]]
                reached.append(there)
    return chains


def frames_of(rows: Floats) -> Floats:
    """Return the frames (N, 4, 4) of places and quaternions (N, 7)."""
    turn = rows[:, 3:] / np.linalg.norm(rows[:, 3:], axis=1, keepdims=True)
    cross = np.cross(np.eye(3), turn[:, None, :3])
    frames = np.tile(np.eye(4), (len(rows), 1, 1))
    frames[:, :3, :3] += 2 * (turn[:, 3, None, None] * cross + cross @ cross)
    frames[:, :3, 3] = rows[:, :3]
    return frames


def poses_of(frames: Floats) -> Floats:
    """Return the poses in the plane (N, 3) of frames (N, 4, 4) [m, m, rad]."""
    return np.column_stack([frames[:, :2, 3], np.arctan2(frames[:, 1, 0], frames[:, 0, 0])])
