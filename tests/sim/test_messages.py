"""Messages about invalid drives, settings and logs, all listed in `messages.yml`."""

import io
import json
import math
import os
import zipfile
from dataclasses import replace

import numpy as np
import pytest

from antdrive.robots import Avoidance, Footprint
from antdrive.sim import Engine, Perception, ReplanPolicy, Rollout, Scenario
from antdrive.sim.log.record import DriveRecord
from antdrive.sim.log.rollout import read_record
from antdrive.worlds import Cruising, Disc, Task, World
from tests.messages import check_messages, numbered, said
from tests.records import changed, made_up_record
from tests.sim.driving.test_driver import TASK
from tests.sim.log.test_rollout import members, packed, put, rewritten, with_movers
from tests.sim.test_settings import BAD, Made, declared

LONG = 10**400
RATES = (
    {"control_hz": 70}, {"control_hz": 5}, {"control_hz": 480}, {"physics_hz": 30, "control_hz": 30}, {"physics_hz": 240.0},
    {"physics_hz": 20_000, "control_hz": 50}, {"control_hz": True},
)  # fmt: skip
SETTINGS = (
    {"seed": "a"}, {"seed": -1}, {"seed": 1.5}, {"seed": True}, {"margin": "0.1"}, {"margin": -0.1}, {"noise": None},
    {"cell": "fine"}, {"unseen": [Disc(3, 3, 0.2)]}, {"unseen": ((3, 3, 0.2),)}, {"perception": "positions"},
    {"avoidance": False}, {"replanning": True}, {"controller": None}, {"task": "forest"}, {"robot": "jackal"},
    {"time_limit": "long"}, {"map": "some"}, {"localisation": "gps"}, {"odometry": -1.0}, {"localisation": "matching"},
    {"planner": None}, {"planner": Disc},
)  # fmt: skip
#: Places in a record and what is written there; None: the key is left out.
RECORDS = (
    ("schema", 99), ("margin", None), ("robot.footprint", None), ("digest", None), ("task", None),
    ("unseen.0", {"y": 1.0, "radius": 0.1, "height": 1.0}), ("colour", "red"), ("robot.colour", "red"), ("margin", "wide"),
    ("margin", LONG), ("margin", -0.1), ("margin", 9.5e15), ("inflate", 9.5e15), ("cell", 9.5e15), ("margin", math.nan),
    ("margin", True), ("physics_hz", "fast"), ("physics_hz", LONG), ("physics_hz", 0), ("physics_hz", 240.5),
    ("outcome", "flew"), ("outcome", [3]), ("task", 3), ("task.obstacles.0.radius", -0.3), ("task.bounds", [0.0, 4.0]),
    ("task.start", [9.0, 9.0, 0.0]), ("task.goal", [LONG, 1.0]), ("robot.footprint", "round"),
    ("unseen", [{"x": 1.0, "y": 1.0, "radius": 0.0, "height": 1.0}]), ("robot.footprint.half_length", -0.1),
    ("robot.max_speed", 0.0), ("robot.mass", math.inf), ("planner.settings", "none"), ("controller.settings.creep", math.nan),
    ("planner.settings.deep", "@"), ("limiters", "cruise"), ("replans", 3), ("replans", ["soon"]), ("seed", "x"), ("seed", -1),
)  # fmt: skip
REPLAN = {"t": 1.0, "trigger": "waited", "solved": False, "cost_m": None, "work": 3, "route": []}
REPLANS = (
    [{**REPLAN, "t": "soon"}], [{**REPLAN, "t": 2.0}, REPLAN], [{**REPLAN, "route": [[1.0]]}], [{**REPLAN, "trigger": None}],
    [{**REPLAN, "solved": True}],
)  # fmt: skip
MOVERS = (
    (0, "keyframes", None), (0, "keyframes", "soon"), (1, "velocity", ["a", "b"]), (0, "radius", -1.0), (2, "walk", 3),
    (2, "walk", {"cell": 0.4, "period": 1e-9}),
)  # fmt: skip


def test_wrong_drives_settings_and_logs_are_refused_in_one_line(
    small_scenario, small_run, turtlebot, jackal, tmp_path, data_regression
):
    def built(foot):
        with Engine(World("w", moving.bounds), replace(jackal, footprint=foot)):
            pass

    def log(place, value):
        path = rewritten(saved, tmp_path, lambda record: put(record, place, value))
        if value == "@":
            with np.load(path) as file:
                arrays = dict(file)
            text = str(arrays.pop("record")).replace('"@"', "[" * 50_000 + "]" * 50_000)
            np.savez_compressed(path, record=np.array(text), **arrays)
        return read(path)

    def read(path):
        words = said(lambda: read_record(path))
        assert words == said(lambda: Rollout.load(path)), "the record alone is refused as the log is"
        Rollout.load(path)

    def moved(index, key, value):
        record = with_movers(made_up_record()).as_dict()
        put(record["task"]["movers"][index], key, value)
        DriveRecord.from_json(json.dumps(record))

    def written(name, content):
        path = tmp_path / name
        path.unlink(missing_ok=True)
        path.write_bytes(content) if isinstance(content, bytes) else content(path)
        return Rollout.load(path)

    def bomb(path):
        packing = zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1)
        with packing as archive, archive.open("t.npy", "w") as member:
            for _ in range(54):
                member.write(bytes(10_000_000))

    def twice(path):
        packed(content, path)
        with zipfile.ZipFile(path, "a") as archive, pytest.warns(UserWarning, match="Duplicate"):
            archive.writestr("t.npy", b"")

    def directory(at, value):
        """The log with another byte in the last entry of its archive's directory."""
        changed = bytearray(raw)
        changed[raw.rindex(b"PK\x01\x02") + at] = value
        return bytes(changed)

    saved = small_run.rollout.save(tmp_path / "run.npz")
    raw, content, huge = saved.read_bytes(), members(saved), io.BytesIO()
    np.lib.format.write_array_header_1_0(huge, {"descr": "<f8", "fortran_order": False, "shape": (10**10,)})
    eight = io.BytesIO()
    np.save(eight, small_run.rollout.pose.astype(np.int8))
    bounds = {one.name: one for one in declared(Made)}
    mapless = replace(small_scenario, map="none")
    moving = World("w", (0, 0, 6, 4), movers=(Cruising(radius=0.5, position=(1.0, 1.0), velocity=(2.0, 0.0)),))
    blocked = Task(World("w", (0, 0, 6, 4), (Disc(2.5, 1.8, 0.4),)), (3.0, 2.0, 0.0), (5.3, 2.0))
    seeing = Scenario.of(changed(blocked, "world", movers=moving.movers, obstacles=()), "astar", map="none")
    rounded = (Footprint(0.3, 0.25, 0.1), Footprint(0.0, 0.0, 0.1, ((0.4, 0.0), (-0.3, 0.3), (-0.3, -0.3))))
    unsensing = replace(jackal, lidar=None)
    calls = {
        "rates": {str(rates): lambda r=rates: replace(small_scenario, **r) for rates in RATES},
        "settings": {str(one): lambda s=one: replace(small_scenario, **s) for one in SETTINGS},
        "bounds": numbered(lambda o=one, v=value: bounds[o].check(v) for one, value in BAD),
        "scenarios": {
            "a start in an obstacle": lambda: Scenario.of(blocked, "astar"),
            "a start in an unseen one": lambda: replace(small_scenario, unseen=(Disc(0.6, 1.6, 0.2),)),
            "another world": lambda: Scenario.of("empti"),
            "options of a planner": lambda: Scenario.of("empty", small_scenario.planner, options={"ants": 3}),
            "a plan in time": lambda: Scenario.of("empty", "sipp", map="none"),
            "no lidar": lambda: replace(mapless, robot=unsensing),
            "no replanning": lambda: replace(mapless, replanning=None),
            "no lidar for movers": lambda: Scenario.of(seeing.task, "astar", unsensing, perception=Perception(kind="lidar")),
            "a drifting pose": lambda: replace(
                seeing, localisation="odometry", perception=Perception()
            ),
        },
        "policies": numbered((
            lambda: Perception(kind="all"), lambda: Perception(range=0.0), lambda: Avoidance(horizon=0.0),
            lambda: Avoidance(min_clearance=math.nan), lambda: ReplanPolicy(patience=-1.0),
            lambda: ReplanPolicy(patience=math.inf), lambda: ReplanPolicy(max_wait=math.nan),
        )),
        "engines": {
            "no trajectories": lambda: Engine(moving, turtlebot),
            "trajectories too many": lambda: Engine(TASK.world, turtlebot, trajectories=seeing.trajectories),
            **{f"{foot}"[:60]: lambda f=foot: built(f) for foot in rounded},
        },
        "metrics": {
            "unknown": lambda: small_run.metric("speed"),
        },
        "records": {f"{place}: {value}"[:60]: lambda p=place, v=value: log(p, v) for place, value in RECORDS},
        "replans": numbered(
            lambda r=replans: DriveRecord.from_json(json.dumps({**made_up_record().as_dict(), "replans": r}))
            for replans in REPLANS
        ),
        "movers": numbered(lambda m=mover: moved(*m) for mover in MOVERS),
        "archives": {
            name: lambda n=name, c=one: written(f"{n}.npz", c)
            for name, one in {
                "empty": b"", "text": b"hello", "broken": b"PK\x03\x04 broken", "a pipe": os.mkfifo,
                "zeros without end": lambda path: path.symlink_to("/dev/zero"), "a bomb": bomb, "a name twice": twice,
                "lzma": lambda path: packed(content, path, zipfile.ZIP_LZMA),
                "ten billion rows": lambda path: packed({**content, "t.npy": huge.getvalue()}, path),
                "no magic": lambda path: packed({**content, "pose.npy": b"pose"}, path),
                "a broken header": lambda path: packed(
                    {**content, "pose.npy": content["pose.npy"].replace(b"{'descr'", b"{'descr(")}, path
                ),
                "encrypted": directory(8, raw[raw.rindex(b"PK\x01\x02") + 8] | 1), "a version to come": directory(6, 99),
                "numbers of 8 bits": lambda path: packed({**content, "pose.npy": eight.getvalue()}, path),
                "other arrays": lambda path: np.savez_compressed(path, a=np.zeros(3)),
                "a plain array": eight.getvalue(),
            }.items()
        },
        "no file": {"a name": lambda: Rollout.load(tmp_path / "nowhere.npz")},
    }  # fmt: skip
    check_messages(calls, data_regression, tmp_path)
