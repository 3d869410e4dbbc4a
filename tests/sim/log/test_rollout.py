"""Logs on disk: what is saved is read again, and what is no log is refused in one line that names the file and the key."""

import dataclasses
import hashlib
import io
import json
import math
import struct
import subprocess
import sys
import zipfile
from dataclasses import replace

import numpy as np
import pytest

from antdrive.base import InputError
from antdrive.base.errors import FieldError
from antdrive.sim import Outcome, Rollout, certify, measure
from antdrive.sim.log import rollout
from antdrive.sim.log.margin import budget
from antdrive.sim.log.record import PROOFS, DriveRecord, Evidence, PlanRecord, SensingRecord, TimesRecord, proofs_of
from antdrive.sim.log.rollout import ARRAYS, read_record
from antdrive.worlds.movers import Cruising, Keyframed, Wandering
from tests.records import changed, made_up_record


@pytest.fixture(scope="module")
def log(small_run):
    return small_run.rollout


@pytest.fixture(scope="module")
def saved(log, tmp_path_factory):
    return log.save(tmp_path_factory.mktemp("logs") / "deep" / "run.npz")


def rewritten(saved, folder, change):
    """A copy of a log with its record changed as JSON."""
    with np.load(saved) as file:
        arrays = dict(file)
    record = json.loads(str(arrays.pop("record")))
    change(record)
    path = folder / "changed.npz"
    np.savez_compressed(path, record=np.array(json.dumps(record, sort_keys=True)), **arrays)
    return path


def with_movers(record):
    movers = (
        Keyframed(radius=0.3, keyframes=((0.0, 3.0, 0.4), (4.0, 5.0, 0.4)), loop="teleport"),
        Cruising(radius=0.2, position=(1.0, 3.5), velocity=(0.5, 0.0), phase=2.0),
        Wandering(radius=0.15, cell=0.4, period=0.8, start=(5.5, 3.5), seed=1),
    )
    return changed(record, "task", world=replace(record.task.world, movers=movers))


def test_a_saved_log_is_read_again_as_it_was(log, saved):
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


def test_a_record_survives_json_with_movers_and_without_optima():
    record = with_movers(made_up_record())
    record = replace(record, plan=replace(record.plan, grid_optimum_m=None), outcome=Outcome.HIT_BY_TELEPORT)
    assert DriveRecord.from_json(record.to_json()) == record
    assert json.loads(record.to_json())["outcome"] == "hit_by_teleport"


def test_the_digest_is_computed_as_the_page_about_the_format_says(saved):
    sha = hashlib.sha256()
    with np.load(saved, allow_pickle=False) as file:
        for name in ARRAYS:
            sha.update(f"{name} {file[name].dtype.str} {file[name].shape}\n".encode() + file[name].tobytes())
        record = json.loads(str(file["record"]))
    digest = record.pop("digest")
    del record["times"], record["written"]
    sha.update(json.dumps(record, sort_keys=True).encode())
    assert sha.hexdigest() == digest


def test_the_digest_covers_the_record_but_not_wall_clock_times(log):
    slower = changed(log.record, "times", plan_s=99.0)
    assert replace(log, record=slower).digest == log.digest
    wider = replace(log.record, margin=log.record.margin + 1e-12)
    assert replace(log, record=wider).digest != log.digest


@pytest.mark.parametrize(
    ("key", "whole"), [("noise", 1), ("margin", 1), ("inflate", 1), ("cell", 1), ("time_limit", 99)]
)
def test_whole_numbers_give_the_digest_of_the_file(log, tmp_path, key, whole):
    written = replace(log, record=replace(log.record, **{key: whole}))
    assert Rollout.load(written.save(tmp_path / "run.npz")).digest == written.digest


def test_what_could_not_be_read_again_is_not_written(log, tmp_path):
    task = log.record.task
    nameless = replace(log.record, task=changed(task, "world", name=""))
    with pytest.raises(ValueError, match=r"record\.task\.name: "):
        replace(log, record=nameless).save(tmp_path / "run.npz")
    assert not list(tmp_path.iterdir())


def test_more_distances_than_can_be_checked_are_a_problem_of_the_log(log, monkeypatch, tmp_path):
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


def test_more_distances_to_movers_than_can_be_checked_are_a_problem_of_the_log(log, monkeypatch):
    mover = Cruising(radius=0.1, position=(0.5, 0.5), velocity=(0.1, 0.0))
    task = changed(log.record.task, "world", movers=(mover, mover))
    rows = len(log.t)
    among = replace(log, record=replace(log.record, task=task), movers=np.zeros((rows, 2, 2)))
    monkeypatch.setattr(rollout, "MAX_NEAR_DISTANCES", 2 * rows)
    assert among.problems() == []
    monkeypatch.setattr(rollout, "MAX_NEAR_DISTANCES", 2 * rows - 1)
    assert among.problems() == [f"t: must have at most {rows - 1} rows in a world of 2 movers, found {rows}"]


def put(record, place, value):
    *path, last = place.split(".")
    found = record
    for part in path:
        found = found[int(part)] if part.isdigit() else found[part]
    if isinstance(found, list):
        found.append(value)
    elif value is None:
        del found[last]
    else:
        found[last] = value


def inner_keys(values, place=()):
    """The places of all keys below the record's own; settings and versions are mappings with free names."""
    for key, value in values.items():
        if isinstance(value, dict) and key not in ("settings", "versions"):
            yield from ((*place, key, inner) for inner in value)
            yield from inner_keys(value, (*place, key))


def test_every_key_that_is_left_out_is_missed_also_one_with_a_default(saved):
    # Records of worlds may have no source, and robots no lidar.
    optional = {("task", "source"), ("robot", "lidar")}
    record = json.loads(str(np.load(saved)["record"]))
    del record["written"]  # older logs lack it
    places = sorted({*((key,) for key in record), *inner_keys(record)} - optional)
    assert ("robot", "lidar", "sigma") in places
    assert ("robot", "wheel_friction") in places
    assert ("robot", "noise", "slip") in places
    for place in places:
        without = json.loads(json.dumps(record))
        put(without, ".".join(place), None)
        with pytest.raises(FieldError) as refused:
            DriveRecord.from_json(json.dumps(without))
        assert ".".join(place[:-1] or place) in str(refused.value)
        assert "\n" not in str(refused.value)


def test_reading_a_log_needs_neither_compiler_nor_planners(saved):
    code = (
        "import sys\n"
        "from antdrive.sim.log.rollout import Rollout\n"
        f"Rollout.load({str(saved)!r})\n"
        "heavy = ('numba', 'pybullet', 'matplotlib', 'PIL', 'imageio', 'scipy')\n"
        "print([name for name in sys.modules if name in heavy or name.startswith('antdrive.planners')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def members(saved):
    with zipfile.ZipFile(saved) as archive:
        return {info.filename: archive.read(info) for info in archive.infolist()}


def packed(content, path, kind=zipfile.ZIP_DEFLATED):
    with zipfile.ZipFile(path, "w", kind) as archive:
        for name, data in content.items():
            with archive.open(name, "w", force_zip64=True) as member:
                member.write(data)


def test_a_log_that_python_3_10_wrote_is_read_anywhere(saved, tmp_path):
    raw, path = bytearray(saved.read_bytes()), tmp_path / "older.npz"
    with zipfile.ZipFile(saved) as archive:
        at = archive.start_dir
        for info in archive.infolist():
            begin = info.header_offset
            raw[begin + 4 : begin + 6] = struct.pack("<H", 20)
            raw[begin + 18 : begin + 26] = struct.pack("<2L", info.compress_size, info.file_size)
            raw[at + 4], raw[at + 6] = 20, 20
            at += 46 + len(info.filename)
    path.write_bytes(raw)
    assert Rollout.load(path).digest == Rollout.load(saved).digest
    raw[4] = 45  # one member as others write it
    path.write_bytes(raw)
    with pytest.raises(InputError, match="other bytes before it"):
        read_record(path)


@pytest.mark.slow
def test_every_byte_around_the_contents_of_a_log_is_as_numpy_writes_it(saved, tmp_path):
    """Only the system that wrote the archive may differ: nobody reads it."""
    raw, path = saved.read_bytes(), tmp_path / "changed.npz"
    with zipfile.ZipFile(saved) as archive:
        contents = [(info.header_offset + 50 + len(info.filename), info.compress_size) for info in archive.infolist()]
        systems, at = set(), archive.start_dir
        for info in archive.infolist():
            systems.add(at + 5)
            at += 46 + len(info.filename)
    inside = {place for begin, size in contents for place in range(begin, begin + size)}
    elsewhere = inside | systems
    around = [place for place in range(len(raw)) if place not in elsewhere]
    assert len(around) > 1000
    for place in around:
        path.write_bytes(raw[:place] + bytes([raw[place] ^ 1]) + raw[place + 1 :])
        with pytest.raises(InputError, match="not a rollout"):
            read_record(path)
    for place in systems:
        path.write_bytes(raw[:place] + bytes([0]) + raw[place + 1 :])
        assert Rollout.load(path).digest == read_record(saved).digest


def npy(array, version=None):
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, array, version)
    return buffer.getvalue()


def padded(member):
    """The array's member with a longer header."""
    size = int.from_bytes(member[8:10], "little")
    return member[:8] + (size + 64).to_bytes(2, "little") + member[10 : 9 + size] + b" " * 64 + member[9 + size :]


def test_other_bytes_for_the_same_values_are_refused(saved, tmp_path):
    raw, content, path = saved.read_bytes(), members(saved), tmp_path / "changed.npz"
    text = str(np.load(saved)["record"])
    pose = np.load(saved)["pose"]

    def repacked(**changed):
        packed({name: changed.get(name.removesuffix(".npy"), data) for name, data in content.items()}, path)

    def added(name, data, **after):
        packed({**content, name: data}, path)

    def texted(other):
        return lambda: repacked(record=npy(np.array(other)))

    def commented():
        path.write_bytes(raw)
        with zipfile.ZipFile(path, "a") as archive:
            archive.comment = b"drive"

    def behind_the_stream():
        """Lengthen the first member behind the end of its packed stream."""
        with zipfile.ZipFile(saved) as archive:
            first, *others = archive.infolist()
            at = archive.start_dir
        data, size = bytearray(raw), (first.compress_size + 4).to_bytes(8, "little")
        data[at + 20 : at + 24] = size[:4]
        for info in others:
            at += 46 + len(first.filename)
            data[at + 42 : at + 46] = (info.header_offset + 4).to_bytes(4, "little")
            first = info
        data[-6:-2] = (int.from_bytes(data[-6:-2], "little") + 4).to_bytes(4, "little")
        begin = 50 + len("record.npy")
        data[begin - 8 : begin] = size
        path.write_bytes(bytes(data[: others[0].header_offset]) + b"more" + data[others[0].header_offset :])

    changes = {
        "a key twice": (texted('{"seed": 99, ' + text[1:]), "record.seed: is given twice"),
        "an inner key twice": (texted(text.replace('"name":', '"name": "other", "name":', 1)), "name: is given twice"),
        "spaces": (texted(text.replace('": ', '":  ', 1)), "record: not the text that antdrive writes"),
        "another number": (texted(text.replace('"noise": 0.0', '"noise": 0')), "record: not the text"),
        "another order": (texted(json.dumps(dict(reversed(json.loads(text).items())))), "record: not the text"),
        "null characters": (lambda: repacked(record=npy(np.array(text, dtype=f"<U{len(text) + 9}"))), "record: not the text"),
        "a member more": (lambda: added("more.npy", content["pose.npy"]), "more.npy: not a member"),
        "a member of another name": (lambda: added("pose", b"x"), "pose: not a member"),
        "an empty array of scans": (lambda: added("scans.npy", npy(np.empty((0, 7), "<u2"))), "omitted where they are empty"),
        "another order of members": (lambda: packed(dict(reversed(content.items())), path), "in another order"),
        "a prefix": (lambda: path.write_bytes(b"#!/bin/sh\n" + raw), "other bytes before it"),
        "bytes behind": (lambda: path.write_bytes(raw + b"more"), "other bytes around its members"),
        "a comment": (commented, "other bytes around its members"),
        "stored members": (lambda: packed(content, path, zipfile.ZIP_STORED), "compressed in another way"),
        "bytes behind a packed stream": (behind_the_stream, "record.npy: damaged"),
        "a longer header": (lambda: repacked(pose=padded(content["pose.npy"])), "pose: its header is not as numpy"),
        "a header of version 2": (lambda: repacked(pose=npy(pose, (2, 0))), "pose: its header is not as numpy"),
        "columns first": (lambda: repacked(pose=npy(np.asfortranarray(pose))), "pose: its header is not as numpy"),
        "bytes behind an array": (lambda: repacked(pose=content["pose.npy"] + b"more"), "pose: its header promises"),
    }  # fmt: skip
    repacked()
    assert path.read_bytes() == raw, "what is written unchanged is the log itself"
    for change, words in changes.values():
        change()
        with pytest.raises(InputError, match=words):
            Rollout.load(path)


def test_no_log_whatever_ends_in_anything_but_one_line(saved, tmp_path):
    """Random bytes, numbers and keys: what can be read at all can be certified, measured and broken down."""
    rng = np.random.default_rng(11)
    raw, content = saved.read_bytes(), members(saved)
    read, refusals = 0, []
    for case in range(100):
        path = tmp_path / "odd.npz"
        if case % 3 == 0:
            path.write_bytes(_flipped(raw, rng))
        elif case % 3 == 1:
            name = str(rng.choice(list(content)))
            packed({**content, name: _flipped(content[name], rng)}, path)
        else:
            record = json.loads(str(np.load(io.BytesIO(content["record.npy"]))[()]))
            _edit(record, rng)
            buffer = io.BytesIO()
            np.save(buffer, np.array(json.dumps(record, sort_keys=True)))
            packed({**content, "record.npy": buffer.getvalue()}, path)
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
    assert read > 8, "some are read"


def _flipped(content, rng):
    changed = bytearray(content)
    for at in rng.integers(0, len(changed), rng.integers(1, 6)):
        changed[at] = rng.integers(0, 256)
    return bytes(changed)


ODD = (None, True, -1, 0, 1e300, -1e-300, 10**400, 2**70, "", "a|b\n", [], {}, [[1, 2]], {"x": 1}, math.nan)


def _edit(record, rng):
    """Another value somewhere in the record."""
    place = record
    while True:
        keys = list(place) if isinstance(place, dict) else list(range(len(place)))
        key = keys[rng.integers(len(keys))]
        if isinstance(place[key], dict | list) and place[key] and rng.random() < 0.8:
            place = place[key]
        else:
            place[key] = ODD[rng.integers(len(ODD))]
            return


def test_every_value_of_a_record_declares_its_check(small_run):
    record = small_run.rollout.record
    keys = {key.partition(".")[0].removesuffix("[]") for key in PROOFS}
    assert keys == {field.name for field in dataclasses.fields(record)}
    assert {f"plan.{key}" for key in record.as_dict()["plan"]} == {key for key in PROOFS if key.startswith("plan.")}
    assert "replans[].route" in PROOFS
    assert PROOFS["versions"] is PROOFS["times.plan_s"] is PROOFS["task.name"] is Evidence.CLAIM

    @dataclasses.dataclass
    class Undeclared:
        plan: PlanRecord
        more: int

    with pytest.raises(TypeError, match="more declares no proof"):
        dict(proofs_of(Undeclared))


def test_times_are_not_negative():
    for key, value in (("plan_s", -1.0), ("drive_wall_s", -1e-9), ("replans_s", (0.1, -0.1))):
        with pytest.raises(FieldError, match=f"{key}.*must be at least 0"):
            TimesRecord(**{"plan_s": 0.0, "drive_wall_s": 0.0, "replans_s": (), key: value})


@pytest.mark.parametrize("key", ["noise", "odometry"])
def test_factors_that_no_scenario_has_are_refused(key, small_run):
    record = small_run.rollout.record
    sensing = SensingRecord(map="given", localisation="odometry", odometry=1e9 if key == "odometry" else 1.0)
    with pytest.raises(FieldError, match=f"^{key}: 1e.09 times the .* is too much"):
        dataclasses.replace(record, sensing=sensing, noise=1e9 if key == "noise" else 0.0)
