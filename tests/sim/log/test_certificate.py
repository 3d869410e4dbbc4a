"""The certificate must be able to fail: every reading, and every hand on the log."""

import json
import math
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from antdrive.sim import Outcome, Rollout, Run, certify
from antdrive.sim.log.certificate import closed_form_clearance, in_metres
from antdrive.worlds import InputError


@pytest.fixture(scope="module")
def log(small_run: Run) -> Rollout:
    assert small_run.rollout is not None
    return small_run.rollout


def changed(log: Rollout, name: str, change: Callable[[np.ndarray], Any]) -> Rollout:
    array = getattr(log, name).copy()
    result = change(array)
    return replace(log, **{name: array if result is None else result})


def test_a_clean_log_is_certified(log: Rollout) -> None:
    certificate = certify(log)
    assert certificate.certified
    assert certificate.problems == ()
    assert 0 < certificate.bound < certificate.min_clearance


def test_no_distance_reads_as_nothing_that_is_not_nothing() -> None:
    assert [in_metres(value) for value in (0.21154, 0.0, -2.7e-5, -0.08)] == [
        "0.2115 m",
        "0.0000 m",
        "-2.7e-05 m",
        "-0.0800 m",
    ]


def test_the_closed_form_shares_no_code_and_agrees(log: Rollout) -> None:
    np.testing.assert_allclose(closed_form_clearance(log), log.clearance, atol=1e-12)


def test_a_finer_walk_between_the_rows_never_undercuts_the_bound(log: Rollout) -> None:
    fine = np.linspace(0, len(log.pose) - 1, 20 * len(log.pose))
    pose = np.stack([np.interp(fine, np.arange(len(log.pose)), np.unwrap(column)) for column in log.pose.T], axis=1)
    assert closed_form_clearance(replace(log, pose=pose)).min() >= certify(log).bound


def _jump(pose: np.ndarray) -> None:
    pose[300, 0] += 0.02


def _into_the_obstacle(pose: np.ndarray) -> None:
    pose[300:320, :2] = (2.0, 1.5)


def _shifted(pose: np.ndarray) -> None:
    pose[:, 1] += 0.3


ROWS = ("t", "pose", "twist", "command", "clearance", "limiter", "movers")
TAMPERINGS: dict[str, tuple[Callable[[Rollout], Rollout], str]] = {
    "a pose": (lambda log: changed(log, "pose", _jump), "do not follow from the measured speed"),
    "poses inside an obstacle": (lambda log: changed(log, "pose", _into_the_obstacle), "overlaps an obstacle"),
    "the whole path": (lambda log: changed(log, "pose", _shifted), "not the task's start"),
    "clearance": (lambda log: changed(log, "clearance", lambda c: c + 0.01), "closed form says"),
    "a contact added": (lambda log: changed(log, "contacts", lambda c: np.array([[5, 0, -0.001, 9.0]])), "disagree"),
    "the end cut off": (
        lambda log: replace(log, **{k: getattr(log, k)[:400] for k in ROWS}),
        "from the goal",
    ),
    "time stretched": (lambda log: changed(log, "t", lambda t: t * 1.01), "rows are not 240 a second"),
    "rows missing": (lambda log: changed(log, "twist", lambda t: t[:-1]), "shape"),
    "not finite": (lambda log: changed(log, "pose", lambda p: np.full_like(p, np.nan)), "not finite"),
    "speeds": (lambda log: changed(log, "twist", lambda t: t * 3), "do not follow from the measured speed"),
    "a smaller robot": (lambda log: _meta(log, "robot", "footprint", "rounding", 0.1), "closed form says"),
    "an obstacle removed": (lambda log: _obstacle(log, []), "closed form says"),
    "an obstacle moved": (
        lambda log: _obstacle(log, [{"x": 2.0, "y": 1.4, "radius": 0.3, "height": 1.0}]), "closed form says"),
    "the outcome": (lambda log: replace(log, meta={**log.meta, "outcome": "collided"}), "with 0 contacts"),
    "the goal": (lambda log: _meta(log, "task", "goal", 0, 1.0), "from the goal"),
    "a NaN obstacle": (lambda log: _obstacle(log, [{"x": 2.0, "y": 1.5, "radius": math.nan, "height": 1.0}]), "impossible"),
    "a negative radius": (lambda log: _obstacle(log, [{"x": 2.0, "y": 1.5, "radius": -0.3, "height": 1.0}]), "impossible"),
    "a NaN robot": (lambda log: _meta(log, "robot", "footprint", "rounding", math.nan), "impossible"),
    "NaN bounds": (lambda log: _meta(log, "task", "bounds", 0, math.nan), "impossible"),
    "a NaN goal": (lambda log: _meta(log, "task", "goal", 0, math.nan), "impossible"),
    "a NaN start": (lambda log: _meta(log, "task", "start", 0, math.nan), "impossible"),
    "no footprint": (lambda log: _meta(log, "robot", "footprint", 3), "impossible"),
    "no task": (lambda log: _meta(log, "task", 3), "impossible"),
    "an unknown outcome": (lambda log: _meta(log, "outcome", "flew"), "impossible"),
    "no rate": (lambda log: _meta(log, "physics_hz", "fast"), "impossible"),
    "text for poses": (lambda log: changed(log, "pose", lambda p: p.astype(str)), "numbers are due"),
    "complex poses": (lambda log: changed(log, "pose", lambda p: p.astype(complex)), "numbers are due"),
    "time as one number": (lambda log: changed(log, "t", lambda t: np.array(3.0)), "shape"),
    "a detour": (lambda log: _detour(log), "do not follow from the measured speed"),
    "nothing left": (
        lambda log: replace(log, **{k: getattr(log, k)[:0] for k in ROWS}),
        "empty",
    ),
}  # fmt: skip


def _detour(log: Rollout) -> Rollout:
    """The path bent 0.4 m aside, by less than a millimetre from row to row, with clearances to match."""
    pose = log.pose.copy()
    pose[:, 1] += 0.4 * np.sin(np.linspace(0, math.pi, len(pose))) ** 2
    bent = replace(log, pose=pose)
    return replace(bent, clearance=closed_form_clearance(bent))


def _meta(log: Rollout, *path_and_value: Any) -> Rollout:
    *path, last, value = path_and_value
    meta = json.loads(json.dumps(dict(log.meta)))
    place = meta
    for key in path:
        place = place[key]
    place[last] = value
    return replace(log, meta=meta)


def _obstacle(log: Rollout, obstacles: list[dict[str, float]]) -> Rollout:
    return _meta(log, "task", "obstacles", obstacles)


@pytest.mark.parametrize("what", TAMPERINGS)
def test_a_log_edited_by_hand_is_found_out_even_with_a_new_digest(log: Rollout, what: str) -> None:
    tamper, says = TAMPERINGS[what]
    edited = tamper(log)
    fresh = replace(edited, meta={**edited.meta, "digest": edited.digest})
    certificate = certify(fresh)
    assert not certificate.certified
    assert any(says in problem for problem in certificate.problems), certificate.problems


def test_the_smallest_edit_breaks_the_digest(log: Rollout, tmp_path: Path) -> None:
    saved = Rollout.load(log.save(tmp_path / "run.npz"))
    assert certify(saved).certified

    def nudge(pose: np.ndarray) -> None:
        pose[300, 0] += 1e-12

    assert certify(changed(saved, "pose", nudge)).problems == ("digest: the log was changed after it was written",)


def test_a_drive_that_grazes_between_rows_is_not_certified(log: Rollout) -> None:
    """Rows 4 mm clear of everything, at a speed that could cover 8 mm and more between them."""
    fast = replace(
        log,
        twist=np.tile([2.0, 0.0], (len(log.t), 1)),
        meta={**log.meta, "robot": {**log.meta["robot"], "footprint": {
            **log.meta["robot"]["footprint"], "rounding": 0.18 + float(log.clearance.min()) - 0.004}}},
    )  # fmt: skip
    certificate = certify(replace(fast, clearance=closed_form_clearance(fast)))
    assert certificate.min_clearance == pytest.approx(0.004)
    assert certificate.bound < 0
    assert any("cannot be ruled out" in problem for problem in certificate.problems)


def test_rollouts_survive_the_disk(log: Rollout, tmp_path: Path) -> None:
    loaded = Rollout.load(log.save(tmp_path / "deep" / "run.npz"))
    assert loaded.digest == log.digest == loaded.meta["digest"]
    assert loaded.outcome is Outcome.SUCCEEDED
    with np.load(tmp_path / "deep" / "run.npz", allow_pickle=False) as plain:
        assert set(plain) >= {
            "t",
            "pose",
            "twist",
            "command",
            "clearance",
            "movers",
            "contacts",
            "route",
            "cells",
            "meta",
        }


@pytest.mark.parametrize("content", [b"", b"hello", b"PK\x03\x04 broken"])
def test_what_is_no_rollout_is_refused_in_one_line(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        Rollout.load(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_archive_of_other_arrays_is_refused(log: Rollout, tmp_path: Path) -> None:
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(InputError, match="not a rollout"):
        Rollout.load(tmp_path / "other.npz")
    np.save(tmp_path / "plain.npy", np.zeros(3))
    with pytest.raises(InputError, match="not a rollout"):
        Rollout.load(tmp_path / "plain.npy")
    with np.load(log.save(tmp_path / "run.npz")) as saved:
        arrays = dict(saved)
    unsigned = {k: v for k, v in json.loads(str(arrays.pop("meta"))).items() if k != "digest"}
    np.savez(tmp_path / "unsigned.npz", meta=np.array(json.dumps(unsigned)), **arrays)
    with pytest.raises(InputError, match="digest: missing"):
        Rollout.load(tmp_path / "unsigned.npz")
    newer = replace(log, meta={**log.meta, "schema": 99})
    with pytest.raises(InputError, match="schema 1, found 99"):
        Rollout.load(newer.save(tmp_path / "newer.npz"))


def test_verify_needs_neither_physics_nor_compiler(log: Rollout, tmp_path: Path) -> None:
    path = log.save(tmp_path / "run.npz")
    code = (
        "import sys\n"
        "for name in ('pybullet', 'numba', 'matplotlib', 'PIL', 'imageio'): sys.modules[name] = None\n"
        "from antdrive.sim.cli import main\n"
        "main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "verify", str(path)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "certified collision-free" in done.stdout
