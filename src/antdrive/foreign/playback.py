"""Playback of foreign logs: rollouts and runs that figures, films, exports, tables and baselines read like those of drives.

What poses do not tell is empty or NaN: commands, contacts, route, plan, and the metrics that need them.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar, cast

import numpy as np

from antdrive.base.errors import FieldError
from antdrive.base.files import write_json
from antdrive.base.plane import poses_at, wrap_angle
from antdrive.base.types import Floats, Point
from antdrive.base.version import versions
from antdrive.foreign.certificate import ForeignCertificate
from antdrive.foreign.setup import ForeignSetup
from antdrive.planners import PlanResult, PlanStatus
from antdrive.proof import Track
from antdrive.sim.facts import Run
from antdrive.sim.log.certificate import Certificate, certify
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.record import DriveRecord, PlanRecord, SmoothingRecord, TimesRecord, canonical_hash
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.log.timeline import speeds
from antdrive.sim.recording import configuration_of
from antdrive.sim.scenario import Scenario
from antdrive.worlds import Grid, Task
from antdrive.worlds.limits import MAX_SPEED
from antdrive.worlds.movers import Keyframed

NAME = "foreign log"  # in place of the planner's
RATE, MOST_ROWS = 60, 500_000  # rows per second [Hz], fewer in long logs


@dataclass(frozen=True, eq=False, kw_only=True)
class ForeignRollout(Rollout):
    """Another program's log at a steady rate, with what it proves."""

    measured: ClassVar[frozenset[str] | None] = frozenset(
        {"min_clearance_m", "mean_clearance_m", "driven_length_m", "duration_s", "turning_rad_per_m"}
    )
    certificate: ForeignCertificate

    def save(self, path: str | Path) -> Path:
        """Raise FieldError: no file may pass for the log of a drive."""
        raise FieldError("rollout", "a foreign log cannot be saved as the log of a drive")

    def write_proof(self, folder: Path) -> dict[str, str]:
        """Write the certificate into a folder; return the file by kind."""
        write_json(folder / "certificate.json", self.certificate.as_dict())
        return {"certificate": str(folder / "certificate.json")}


@certify.register
def _(rollout: ForeignRollout) -> Certificate:
    """Return the foreign certificate; it has all that views read of a certificate."""
    return cast("Certificate", rollout.certificate)


class _Unchecked:
    def __post_init__(self) -> None:
        """Take all values: a log may begin and end anywhere, and nothing drives it."""


class _Ends(_Unchecked, Task):
    """Task of a log."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Logged(_Unchecked, Scenario):
    """Scenario of a log; its setup stands in the planner's place."""

    certificate: ForeignCertificate

    @property
    def sources(self) -> Mapping[str, str]:
        """Hashes of the log, and of the world without the log's ends."""
        ends = dataclasses.replace(self.task, start=(0.0, 0.0, 0.0), goal=(0.0, 0.0))
        return {"world": canonical_hash(ends), "log": self.certificate.as_dict()["sha256"]}


def foreign_run(found: ForeignCertificate, setup: ForeignSetup, goal: Point | None = None) -> Run:
    """Return another program's log as a run.

    Its outcome is `COLLIDED` if the robot touched something, `STOPPED` if it ends off a given goal [m], else `SUCCEEDED`.
    """
    track, *others = (dataclasses.replace(one, t=one.t - found.tracks[0].t[0]) for one in found.tracks)
    end, exact = float(track.t[-1]), found.proof.clearance + found.proof.off
    hz = max(1, min(RATE, int(MOST_ROWS / max(end, 1.0))))
    t = np.append(np.arange(0.0, max(end - 0.5 / hz, 0.0), 1 / hz), end)
    pose, clearance = _at(t, track), np.interp(t, track.t, exact)
    np.minimum.at(clearance, np.round(track.t * hz).astype(np.int64).clip(0, len(t) - 1), exact)  # keeps the least
    twist = speeds(t, pose)
    twist[:, 0] = np.minimum(twist[:, 0], found.robot.max_speed)  # a longer step is a correction
    task = _Ends(found.world, tuple(pose[0].tolist()), goal or tuple(pose[-1, :2].tolist()), frame=found.frame)
    left, outcome, reason = float(np.hypot(*(pose[-1, :2] - task.goal))), Outcome.SUCCEEDED, ""
    if found.touched:
        outcome, reason = Outcome.COLLIDED, found.problems[0]
    elif left > task.goal_tolerance:
        outcome, reason = Outcome.STOPPED, f"the log ends {left:.2f} m from the goal"
    places = [_at(t, other)[:, :2] for other in others]
    movers = tuple(_disc(t, xy, other) for xy, other in zip(places, others, strict=True))
    bare, shown = (
        dataclasses.replace(task, world=dataclasses.replace(found.world, movers=some)) for some in ((), movers)
    )
    words: Any = {"task": bare, "planner": setup, "planner_name": NAME, "robot": found.robot, "margin": 0.0}
    s = _Logged(certificate=found, physics_hz=hz, control_hz=hz, **words)
    grid = Grid(np.ones((1, 1), dtype=bool), np.zeros((1, 1), dtype=np.uint8), task.cell)
    plan = PlanResult(status=PlanStatus.NO_PATH, options=vars(setup))
    no_plan: Any = dict.fromkeys(("cost_m", "grid_optimum_m", "euclidean_optimum_m"))
    more: Any = {"task": shown, "inflate": 0.0, "time_limit": max(end, 1.0), "outcome": outcome, "reason": reason}
    more |= {"replans": (), "limiters": (), "versions": versions()}
    record = DriveRecord(
        **configuration_of(s, grid, plan) | more,
        plan=PlanRecord(length_m=0.0, work=0, work_unit="", **no_plan),
        smoothing=SmoothingRecord(asked=s.smoothing, made="none", note=""),
        times=TimesRecord(plan_s=0.0, drive_wall_s=0.0, replans_s=()),
    )
    arrays: Any = {"pose": pose, "twist": twist, "command": np.full_like(twist, np.nan), "clearance": clearance}
    arrays |= {"movers": np.stack(places, axis=1) if places else np.empty((len(t), 0, 2)), "route": np.empty((0, 2))}
    arrays |= {"limiter": np.zeros(len(t), np.uint8), "contacts": np.empty((0, 4)), "cells": np.empty((0, 2), np.int32)}
    rollout = ForeignRollout(t=t, **arrays, record=record, certificate=found)
    return Run(s, grid, plan, rollout, certify(rollout))


def _at(t: Floats, track: Track) -> Floats:
    """Return a track's poses at times, held before and after it (T, 3)."""
    known = np.isfinite(track.pose[:, 0])
    pose = poses_at(t, track.t[known], track.pose[known])
    return np.column_stack([pose[:, :2], wrap_angle(pose[:, 2])])


def _disc(t: Floats, places: Floats, track: Track) -> Keyframed:
    """Return the disc around another robot at places (T, 2) [m], for pictures; it leaves out what is too fast."""
    frames = np.column_stack([t, places])[np.unique(np.linspace(0, len(t) - 1, 500).astype(int))].tolist()
    kept = [a for a, b in pairwise(frames) if math.dist(a[1:], b[1:]) < MAX_SPEED * (b[0] - a[0])]
    return Keyframed(radius=track.footprint.radius, keyframes=tuple(map(tuple, [*kept, frames[-1]])), loop="once")
