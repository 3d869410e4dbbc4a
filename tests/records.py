"""A record of a drive that was never driven, for tests that make up a log."""

from typing import Any

from antdrive.robots import load_robot
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.record import ComponentRecord, DriveRecord, PlanRecord, SmoothingRecord, TimesRecord
from antdrive.worlds import Task, World


def made_up_record(**changes: Any) -> DriveRecord:
    """The record of a plain success from (1, 1) to (5, 1) in an empty world; `changes` replace its fields."""
    values: dict[str, Any] = {
        "task": Task(World("made-up", (0.0, 0.0, 6.0, 4.0)), (1.0, 1.0, 0.0), (5.0, 1.0)),
        "unseen": (),
        "seed": 0,
        "planner": ComponentRecord(name="astar", settings={}),
        "plan": PlanRecord(
            cost_m=4.0,
            length_m=4.0,
            grid_optimum_m=4.0,
            euclidean_optimum_m=4.0,
            work=17,
            work_unit="cells expanded",
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
