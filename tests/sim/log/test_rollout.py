"""Logs on disk: what is saved is read again, and what is no log is refused in one line that names the file and the key."""

import hashlib
import io
import json
import math
import os
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from antdrive.base import InputError
from antdrive.base.errors import FieldError
from antdrive.sim import Outcome, Rollout, Run, certify, measure
from antdrive.sim.log import rollout
from antdrive.sim.log.margin import budget
from antdrive.sim.log.record import DriveRecord
from antdrive.sim.log.rollout import ARRAYS, read_record
from antdrive.worlds.movers import Cruising, Keyframed, Wandering
from tests.records import made_up_record


@pytest.fixture(scope="module")
def log(small_run: Run) -> Rollout:
    assert small_run.rollout is not None
    return small_run.rollout


@pytest.fixture(scope="module")
def saved(log: Rollout, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return log.save(tmp_path_factory.mktemp("logs") / "deep" / "run.npz")


def rewritten(saved: Path, folder: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    """A copy of a log with its record changed as JSON."""
    with np.load(saved) as file:
        arrays = dict(file)
    record = json.loads(str(arrays.pop("record")))
    change(record)
    path = folder / "changed.npz"
    np.savez(path, record=np.array(json.dumps(record)), **arrays)
    return path


def with_movers(record: DriveRecord) -> DriveRecord:
    movers = (
        Keyframed(radius=0.3, keyframes=((0.0, 3.0, 0.4), (4.0, 5.0, 0.4)), loop="teleport"),
        Cruising(radius=0.2, position=(1.0, 3.5), velocity=(0.5, 0.0), phase=2.0),
        Wandering(radius=0.15, cell=0.4, period=0.8, start=(5.5, 3.5), seed=1),
    )
    return replace(record, task=replace(record.task, world=replace(record.task.world, movers=movers)))


def test_a_saved_log_is_read_again_as_it_was(log: Rollout, saved: Path) -> None:
    loaded = Rollout.load(saved)
    assert loaded.digest == log.digest == loaded.record.digest
    assert loaded.outcome is Outcome.SUCCEEDED
    assert replace(loaded.record, digest=None) == log.record
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(loaded, name), getattr(log, name))
        assert getattr(loaded, name).dtype == getattr(log, name).dtype
    with np.load(saved, allow_pickle=False) as plain:
        assert set(plain) == {*ARRAYS, "record"}
    assert read_record(saved) == loaded.record


def test_a_record_survives_json_with_movers_and_without_optima() -> None:
    record = with_movers(made_up_record())
    record = replace(record, plan=replace(record.plan, grid_optimum_m=None), outcome=Outcome.HIT_BY_TELEPORT)
    assert DriveRecord.from_json(record.to_json()) == record
    assert json.loads(record.to_json())["outcome"] == "hit_by_teleport"


def test_the_digest_is_computed_as_the_page_about_the_format_says(saved: Path) -> None:
    sha = hashlib.sha256()
    with np.load(saved, allow_pickle=False) as file:
        for name in ARRAYS:
            sha.update(f"{name} {file[name].dtype.str} {file[name].shape}\n".encode() + file[name].tobytes())
        record = json.loads(str(file["record"]))
    digest = record.pop("digest")
    del record["times"]
    sha.update(json.dumps(record, sort_keys=True).encode())
    assert sha.hexdigest() == digest


def test_the_digest_covers_the_record_but_not_wall_clock_times(log: Rollout) -> None:
    slower = replace(log.record, times=replace(log.record.times, plan_s=99.0))
    assert replace(log, record=slower).digest == log.digest
    wider = replace(log.record, margin=log.record.margin + 1e-12)
    assert replace(log, record=wider).digest != log.digest


def test_what_could_not_be_read_again_is_not_written(log: Rollout, tmp_path: Path) -> None:
    task = log.record.task
    nameless = replace(log.record, task=replace(task, world=replace(task.world, name="")))
    with pytest.raises(ValueError, match=r"record\.task\.name: "):
        replace(log, record=nameless).save(tmp_path / "run.npz")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("content", [b"", b"hello", b"PK\x03\x04 broken"])
def test_a_file_that_is_no_rollout_is_refused_in_one_line(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    path.write_bytes(content)
    for load in (Rollout.load, read_record):
        with pytest.raises(InputError) as caught:
            load(path)
        assert str(caught.value).startswith(f"{path}: not a rollout")
        assert "\n" not in str(caught.value)


def test_other_archives_and_arrays_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        Rollout.load(tmp_path / "nowhere.npz")
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(InputError, match=r"other\.npz: not a rollout: t is not a file in the archive"):
        Rollout.load(tmp_path / "other.npz")
    np.save(tmp_path / "plain.npy", np.zeros(3))
    with pytest.raises(InputError, match="not a rollout"):
        Rollout.load(tmp_path / "plain.npy")


def test_a_log_of_a_later_version_is_refused(saved: Path, tmp_path: Path) -> None:
    def later(record: dict[str, Any]) -> None:
        record["schema"] = 99

    with pytest.raises(InputError, match=r"changed\.npz: record\.schema: this version reads schema 2, found 99"):
        Rollout.load(rewritten(saved, tmp_path, later))


def test_more_distances_than_can_be_checked_are_a_problem_of_the_log(
    log: Rollout, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    rows = len(log.t)
    things = len(log.record.world.obstacles) + len(log.record.world.movers)
    log.save(tmp_path / "run.npz")
    monkeypatch.setattr(rollout, "MAX_LOG_DISTANCES", rows * things)
    assert log.problems() == []
    monkeypatch.setattr(rollout, "MAX_LOG_DISTANCES", rows * things - 1)
    found = f"t: must have at most {rows - 1} rows in a world of {things} obstacles and movers, found {rows}"
    assert log.problems() == [found]
    with pytest.raises(InputError, match=rf"run\.npz: not a rollout \({found}\)"):
        Rollout.load(tmp_path / "run.npz")


def test_more_distances_to_movers_than_can_be_checked_are_a_problem_of_the_log(
    log: Rollout, monkeypatch: pytest.MonkeyPatch
) -> None:
    mover = Cruising(radius=0.1, position=(0.5, 0.5), velocity=(0.1, 0.0))
    task = replace(log.record.task, world=replace(log.record.task.world, movers=(mover, mover)))
    rows = len(log.t)
    among = replace(log, record=replace(log.record, task=task), movers=np.zeros((rows, 2, 2)))
    monkeypatch.setattr(rollout, "MAX_NEAR_DISTANCES", 2 * rows)
    assert among.problems() == []
    monkeypatch.setattr(rollout, "MAX_NEAR_DISTANCES", 2 * rows - 1)
    assert among.problems() == [f"t: must have at most {rows - 1} rows in a world of 2 movers, found {rows}"]


LONG = 10**400
#: A place in the record, what is written there, and how the refusal goes on after the place. None: the key is left out.
WRONG: dict[str, tuple[str, Any, str]] = {
    "no margin": ("margin", None, "missing; clearance that was planned with on top of the robot's radius [m]"),
    "no footprint": ("robot.footprint", None, "missing; "),
    "no digest": ("digest", None, "missing; a log that antdrive wrote has it"),
    "no task": ("task", None, "missing; the world, start and goal"),
    "no x": ("unseen.0", {"y": 1.0, "radius": 0.1, "height": 1.0}, ""),
    "an unknown key": ("colour", "red", "unknown key; a later version of antdrive may have written it"),
    "an unknown key inside": ("robot.colour", "red", "unknown key"),
    "a margin of text": ("margin", "wide", 'must be a valid number, got "wide"'),
    "a margin of 400 digits": ("margin", LONG, "must be a finite number, got "),
    "a negative margin": ("margin", -0.1, "must be at least 0, got -0.1"),
    "a margin of a light year": ("margin", 9.5e15, "must be at most 1000 m, got 9"),
    "an inflation of a light year": ("inflate", 9.5e15, "must be at most 1000 m, got 9"),
    "a cell of a light year": ("cell", 9.5e15, "must be at most 1e+06 m, got 9"),
    "a NaN margin": ("margin", math.nan, ""),
    "a margin that is true": ("margin", True, "must be a valid number, got true"),
    "a rate of text": ("physics_hz", "fast", "must be a valid integer"),
    "a rate of 400 digits": ("physics_hz", LONG, "must be between 1 and 10000"),
    "no rate": ("physics_hz", 0, "must be between 1 and 10000, got 0"),
    "half a rate": ("physics_hz", 240.5, "must be a valid integer"),
    "an unknown outcome": ("outcome", "flew", "unknown outcome 'flew'; choose from succeeded, collided"),
    "an outcome of numbers": ("outcome", [3], "unknown outcome '[3]'; choose from"),
    "a task of numbers": ("task", 3, "must be an object as in a world file, got 3"),
    "a negative radius": ("task.obstacles.0.radius", -0.3, "must be greater than 0, got -0.3"),
    "bounds of two": ("task.bounds", [0.0, 4.0], "must have 4 entries, got 2"),
    "a start outside": ("task.start", [9.0, 9.0, 0.0], "(9, 9) is out of bounds"),
    "a goal of 400 digits": ("task.goal", [LONG, 1.0], ""),
    "an unseen cylinder of radius 0": ("unseen", [{"x": 1.0, "y": 1.0, "radius": 0.0, "height": 1.0}], ""),
    "a footprint of text": ("robot.footprint", "round", ""),
    "a negative footprint": ("robot.footprint.half_length", -0.1, "must be at least 0, got -0.1"),
    "no speed": ("robot.max_speed", 0.0, ""),
    "an infinite mass": ("robot.mass", math.inf, ""),
    "settings of text": ("planner.settings", "none", "must be an object"),
    "a setting of NaN": ("controller.settings.creep", math.nan, ""),
    "nested too deeply": ("planner.settings.deep", "@", ""),
    "limiters of text": ("limiters", "cruise", "must be a valid array"),
    "replans that are no list": ("replans", 3, "must be a valid array, got 3"),
    "a replan of text": ("replans", ["soon"], ""),
    "a seed of text": ("seed", "x", "must be a valid integer"),
    "a negative seed": ("seed", -1, "must be at least 0, got -1"),
}


def put(record: dict[str, Any], place: str, value: Any) -> None:
    *path, last = place.split(".")
    found: Any = record
    for part in path:
        found = found[int(part)] if part.isdigit() else found[part]
    if isinstance(found, list):
        found.append(value)
    elif value is None:
        del found[last]
    else:
        found[last] = value


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_record_is_refused_in_one_line_that_names_the_key(what: str, saved: Path, tmp_path: Path) -> None:
    place, value, says = WRONG[what]
    path = rewritten(saved, tmp_path, lambda record: put(record, place, value))
    if value == "@":
        with np.load(path) as file:
            arrays = dict(file)
        text = str(arrays.pop("record")).replace('"@"', "[" * 50_000 + "]" * 50_000)
        np.savez(path, record=np.array(text), **arrays)
    for load in (Rollout.load, read_record):
        with pytest.raises(InputError) as caught:
            load(path)
        message = str(caught.value)
        assert message.startswith(f"{path}: record")
        assert "\n" not in message
        assert len(message) < len(str(path)) + 250
        if says:
            *parents, last = place.split(".")
            assert last in message
            assert says in message
            assert message.startswith(f"{path}: record." + ".".join(parents[:1] or [last]))


REPLAN = {"t": 1.0, "trigger": "waited", "solved": False, "cost_m": None, "work": 3, "route": []}
WRONG_REPLANS: dict[str, tuple[list[dict[str, Any]], str]] = {
    "a time of text": ([{**REPLAN, "t": "soon"}], "replans[0].t: "),
    "in disorder": ([{**REPLAN, "t": 2.0}, REPLAN], "replans[1].t: must not be before 2 s, got 1"),
    "a route of one number": ([{**REPLAN, "route": [[1.0]]}], "replans[0].route[0]"),
    "no trigger": ([{**REPLAN, "trigger": None}], "replans[0].trigger: "),
    "solved without a route": ([{**REPLAN, "solved": True}], "replans[0].route: must have two points or more if solved"),
}  # fmt: skip


@pytest.mark.parametrize("what", WRONG_REPLANS)
def test_wrong_replans_are_refused(what: str) -> None:
    replans, says = WRONG_REPLANS[what]
    text = json.dumps({**made_up_record().as_dict(), "replans": replans})
    with pytest.raises(ValueError) as caught:
        DriveRecord.from_json(text)
    assert str(caught.value).startswith(f"record.{says}")


WRONG_MOVERS: dict[str, tuple[int, str, Any, str]] = {
    "no motion": (0, "keyframes", None, "movers[0]"),
    "a motion of text": (0, "keyframes", "soon", "movers[0].keyframes: "),
    "a velocity of text": (1, "velocity", ["a", "b"], "movers[1].velocity"),
    "a negative radius": (0, "radius", -1.0, "movers[0].radius: must be greater than 0"),
    "a walk of numbers": (2, "walk", 3, "movers[2].walk: "),
    "a walk without end": (2, "walk", {"cell": 0.4, "period": 1e-9}, "movers[2].walk.period: must be at least"),
}


@pytest.mark.parametrize("what", WRONG_MOVERS)
def test_wrong_movers_are_refused(what: str) -> None:
    index, key, value, says = WRONG_MOVERS[what]
    record = with_movers(made_up_record()).as_dict()
    put(record["task"]["movers"][index], key, value)
    with pytest.raises(ValueError) as caught:
        DriveRecord.from_json(json.dumps(record))
    assert str(caught.value).startswith(f"record.task.{says}")


def test_every_key_that_is_left_out_is_missed(saved: Path, tmp_path: Path) -> None:
    for key in DriveRecord.from_json(made_up_record().to_json()).as_dict():
        path = rewritten(saved, tmp_path, lambda record, key=key: record.pop(key))  # type: ignore[misc]
        with pytest.raises(InputError, match=rf"record\.{key}: "):
            Rollout.load(path)


def inner_keys(values: dict[str, Any], place: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """The places of all keys below the record's own; settings and versions are mappings with free names."""
    for key, value in values.items():
        if isinstance(value, dict) and key not in ("settings", "versions"):
            yield from ((*place, key, inner) for inner in value)
            yield from inner_keys(value, (*place, key))


def test_keys_with_defaults_are_missed_like_any_other(saved: Path, tmp_path: Path) -> None:
    # Records of worlds may have no source, and robots no lidar.
    optional = {("task", "source"), ("robot", "lidar")}
    places = sorted(set(inner_keys(json.loads(str(np.load(saved)["record"])))) - optional)
    assert ("robot", "lidar", "sigma") in places
    assert ("robot", "wheel_friction") in places
    assert ("robot", "noise", "slip") in places
    for place in places:

        def remove(record: dict[str, Any], place: tuple[str, ...] = place) -> None:
            for key in place[:-1]:
                record = record[key]
            del record[place[-1]]

        with pytest.raises(InputError) as refused:
            Rollout.load(rewritten(saved, tmp_path, remove))
        assert ".".join(place[:-1]) in str(refused.value)
        assert "\n" not in str(refused.value)


def test_reading_a_log_needs_neither_compiler_nor_planners(saved: Path) -> None:
    code = (
        "import sys\n"
        "from antdrive.sim.log.rollout import Rollout\n"
        f"Rollout.load({str(saved)!r})\n"
        "heavy = ('numba', 'pybullet', 'matplotlib', 'PIL', 'imageio', 'scipy')\n"
        "print([name for name in sys.modules if name in heavy or name.startswith('antdrive.planners')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


NOT_LOGS: dict[str, Callable[[Path, Path], Path]] = {}


def not_a_log(make: Callable[[Path, Path], None]) -> Callable[[Path, Path], None]:
    def made(saved: Path, folder: Path) -> Path:
        make(saved, folder / "odd.npz")
        return folder / "odd.npz"

    NOT_LOGS[make.__name__.strip("_")] = made
    return make


def members(saved: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(saved) as archive:
        return {info.filename: archive.read(info) for info in archive.infolist()}


def packed(content: dict[str, bytes], path: Path, kind: int = zipfile.ZIP_DEFLATED) -> None:
    with zipfile.ZipFile(path, "w", kind) as archive:
        for name, data in content.items():
            archive.writestr(name, data)


@not_a_log
def _a_pipe(saved: Path, path: Path) -> None:
    os.mkfifo(path)


@not_a_log
def _zeros_without_end(saved: Path, path: Path) -> None:
    path.symlink_to("/dev/zero")


@not_a_log
def _lzma(saved: Path, path: Path) -> None:
    packed(members(saved), path, zipfile.ZIP_LZMA)


@not_a_log
def _ten_billion_rows(saved: Path, path: Path) -> None:
    content = members(saved)
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": (10**10,)})
    packed({**content, "t.npy": head.getvalue()}, path)


@not_a_log
def _members_without_magic(saved: Path, path: Path) -> None:
    packed({**members(saved), "pose.npy": b"pose"}, path)


@not_a_log
def _a_broken_header(saved: Path, path: Path) -> None:
    content = members(saved)
    packed({**content, "pose.npy": content["pose.npy"].replace(b"{'descr'", b"{'descr(")}, path)


@not_a_log
def _a_bomb(saved: Path, path: Path) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("t.npy", "w") as member:
        for _ in range(70):
            member.write(bytes(10_000_000))


@not_a_log
def _encrypted(saved: Path, path: Path) -> None:
    content = bytearray(saved.read_bytes())
    at = content.rindex(b"PK\x01\x02")
    content[at + 8] |= 1
    path.write_bytes(content)


@not_a_log
def _a_version_to_come(saved: Path, path: Path) -> None:
    content = bytearray(saved.read_bytes())
    content[content.rindex(b"PK\x01\x02") + 6] = 99
    path.write_bytes(content)


@not_a_log
def _a_name_twice(saved: Path, path: Path) -> None:
    packed(members(saved), path)
    with zipfile.ZipFile(path, "a") as archive, pytest.warns(UserWarning, match="Duplicate"):
        archive.writestr("t.npy", b"")


@not_a_log
def _numbers_of_8_bits(saved: Path, path: Path) -> None:
    with np.load(saved) as file:
        arrays = dict(file)
    np.savez(path, **{**arrays, "pose": arrays["pose"].astype(np.int8)})


@pytest.mark.parametrize("what", NOT_LOGS)
def test_hostile_archives_are_refused_in_one_line(what: str, saved: Path, tmp_path: Path) -> None:
    path = NOT_LOGS[what](saved, tmp_path)
    with pytest.raises(InputError) as caught:
        Rollout.load(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    assert len(message) < len(str(path)) + 400


def test_no_log_whatever_ends_in_anything_but_one_line(saved: Path, tmp_path: Path) -> None:
    """Random bytes, numbers and keys: what can be read at all can be certified, measured and broken down."""
    rng = np.random.default_rng(11)
    raw, content = saved.read_bytes(), members(saved)
    read, refusals = 0, []
    for case in range(240):
        path = tmp_path / "odd.npz"
        if case % 3 == 0:
            path.write_bytes(_flipped(raw, rng))
        elif case % 3 == 1:
            name = str(rng.choice(list(content)))
            packed({**content, name: _flipped(content[name], rng)}, path, zipfile.ZIP_STORED)
        else:
            record = json.loads(str(np.load(io.BytesIO(content["record.npy"]))[()]))
            _edit(record, rng)
            buffer = io.BytesIO()
            np.save(buffer, np.array(json.dumps(record)))
            packed({**content, "record.npy": buffer.getvalue()}, path, zipfile.ZIP_STORED)
        try:
            log = Rollout.load(path)
            certificate = certify(log)
            assert not certificate.certified or log.digest == log.record.digest
            assert all("\n" not in problem for problem in certificate.problems)
            measure(log)
            budget(log)
            read += 1
        except (InputError, FieldError) as error:
            refusals.append(str(error))
    assert not any("\n" in refusal for refusal in refusals)
    assert read > 20, "some are read"


def _flipped(content: bytes, rng: np.random.Generator) -> bytes:
    changed = bytearray(content)
    for at in rng.integers(0, len(changed), rng.integers(1, 6)):
        changed[at] = rng.integers(0, 256)
    return bytes(changed)


ODD = (None, True, -1, 0, 1e300, -1e-300, 10**400, 2**70, "", "a|b\n", [], {}, [[1, 2]], {"x": 1}, math.nan)


def _edit(record: dict[str, Any], rng: np.random.Generator) -> None:
    """Another value somewhere in the record."""
    place: Any = record
    while True:
        keys = list(place) if isinstance(place, dict) else list(range(len(place)))
        key = keys[rng.integers(len(keys))]
        if isinstance(place[key], dict | list) and place[key] and rng.random() < 0.8:
            place = place[key]
        else:
            place[key] = ODD[rng.integers(len(ODD))]
            return
