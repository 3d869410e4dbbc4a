"""Records and logs of drives that were never driven, changes of what is frozen, and rates of cheap drives."""

from dataclasses import replace

import numpy as np

from antdrive.robots import load_robot
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.record import ComponentRecord, DriveRecord, PlanRecord, SmoothingRecord, TimesRecord
from antdrive.sim.log.rollout import Rollout
from antdrive.worlds import Task, World

#: Rates at which a drive costs a third, for tests that do not depend on them.
COARSE = {"physics_hz": 80, "control_hz": 20}


def made_up_record(**changes):
    """The record of a plain success from (1, 1) to (5, 1) in an empty world; `changes` replace its fields."""
    values = {
        "task": Task(World("made-up", (0.0, 0.0, 6.0, 4.0)), (1.0, 1.0, 0.0), (5.0, 1.0)),
        "unseen": (),
        "seed": 0,
        "planner": ComponentRecord(name="astar", settings={}),
        "plan": PlanRecord(
            cost_m=4.0, length_m=4.0, grid_optimum_m=4.0, euclidean_optimum_m=4.0, work=17, work_unit="cells expanded"
        ),
        "robot": load_robot("turtlebot"),
        "controller": ComponentRecord(name="PurePursuit", settings={}),
        "smoothing": SmoothingRecord(asked="clearance", made="clearance", note=""),
        "perception": None,
        "avoidance": None,
        "replanning": None,
        "replans": (),
        "limiters": ("cruise", "curvature"),
        "noise": 0.0,
        "margin": 0.05,
        "inflate": 0.23,
        "cell": 0.25,
        "physics_hz": 240,
        "control_hz": 60,
        "time_limit": 60.0,
        "outcome": Outcome.SUCCEEDED,
        "reason": "",
        "versions": {"antdrive": "0"},
        "times": TimesRecord(plan_s=0.25, drive_wall_s=1.5, replans_s=()),
    }
    return DriveRecord(**{**values, **changes})


def changed(of, place, **values):
    """A frozen record with other values at a place within it, as in `changed(log, "record.task.world", movers=())`."""
    name, _, rest = place.partition(".")
    inner = getattr(of, name)
    return replace(of, **{name: changed(inner, rest, **values) if rest else replace(inner, **values)})


def made_up_log(pose, hz, record, **arrays):
    """The log of poses (T, 3) at a rate [1/s]; what `arrays` leave out is at rest, clear by 1 m, and empty."""
    rows = len(pose)
    given = {
        "t": np.arange(rows) / hz, "twist": np.zeros((rows, 2)), "command": np.zeros((rows, 2)), "clearance": np.ones(rows),
        "limiter": np.zeros(rows, np.uint8), "movers": np.empty((rows, 0, 2)), "contacts": np.empty((0, 4)),
        "route": np.array(pose)[[0, -1], :2], "cells": np.empty((0, 2), np.int32), **arrays,
    }  # fmt: skip
    return Rollout(pose=pose, record=record, **given)
