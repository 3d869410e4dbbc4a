"""Every command without PyBullet: it works, or it refuses before any work in the line of `require_physics`."""

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from antdrive import run
from antdrive.base import version
from antdrive.base.errors import InputError
from antdrive.cli import warming
from antdrive.cli.commands import COMMANDS, ROBOTS, WORLDS
from antdrive.runs.campaigns.sweeping import sweep
from antdrive.runs.pool import Pool
from antdrive.views.run_folder import write_run
from antdrive.worlds.formats.sdf import export_sdf
from tests.cli.conftest import PLANNERS, written

URDF = Path(__file__).parents[1] / "robots" / "importing" / "urdf" / "pioneer3dx.urdf"
MISSING = "drives need "  # followed by it, or by PyBullet where it has no wheel

WORKS = {
    "init": ("mine",),
    "plan": ("small.yaml", "small.yaml --planner dijkstra -o plan.png"),
    "compare": ("camp",),
    "sweep": ("-w small.yaml -p astar --dry-run",),
    "barn": ("paths --score log.txt",),
    "view": ("log.npz", "log.npz log.npz --label one --label two -o both.html"),
    "render": ("log.npz -o film.gif --fps 1 --size 160x160", "log.npz -o frame.png --at 1 --size 160x160"),
    "report": ("kept -o report.html", "camp -o report.md"),
    "export": ("log.npz --to csv -o csv",),
    "verify": ("log.npz",),
    "certify": ("log.csv --map small.yaml",),
    "check": ("log.drive.yaml",),
    "accept": ("log.drive.yaml",),
    "margin": ("log.npz",),
    "planners": ("", "astar"),
    "controller": ("",),
    "schema": ("suite",),
    "warm": ("",),
    "worlds list": ("",),
    "worlds show": ("small.yaml -o world.png",),
    "worlds generate": ("forest -o forest.yaml",),
    "worlds import": ("small.sdf -o again.yaml",),
    "worlds export": ("small.yaml -o again.sdf",),
    "robots list": ("",),
    "robots print": ("turtlebot",),
    "robots show": ("turtlebot -o robot.png",),
    "robots import": ("pioneer.urdf -o mine.yaml",),
}
REFUSES = {
    "demo": "",
    "run": "small.yaml --film film.mp4",
    "compare": "small.yaml -p astar -p dijkstra",
    "sweep": "-w small.yaml -p astar -o new",
    "barn": "paths",
    "verify": "log.npz --replay",
    "check": "small.drive.yaml",
    "accept": "small.drive.yaml",
    "plan": "small.yaml --margin auto",
    "find-margin": "small.yaml",
    "falsify": "--budget 1",
    "shrink": "log.npz",
}


@pytest.fixture
def folder(tmp_path, small, small_run, monkeypatch):
    """Inputs of every command in a folder; PyBullet is missing."""
    small_run.rollout.save(tmp_path / "log.npz")
    write_run(small_run, tmp_path / "kept", "antdrive run small.yaml", None)
    export_sdf(small_run.scenario.task, tmp_path / "small.sdf")
    (tmp_path / "small.drive.yaml").write_text("schema: 1\nscenarios:\n  a: {world: small.yaml}\n")
    (tmp_path / "log.drive.yaml").write_text(
        "schema: 1\nscenarios:\n  a: {log: log.csv, world: small.yaml, baseline: false}\n"
    )
    rows = np.column_stack([small_run.rollout.t, small_run.rollout.pose])[::8]
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header="t,x,y,yaw", comments="")
    shutil.copy(URDF, tmp_path / "pioneer.urdf")
    written(tmp_path / "camp", PLANNERS)
    (tmp_path / "paths").mkdir()
    np.save(tmp_path / "paths" / "path_6.npy", np.array([(15.5, 0), (15.5, 29)]))
    (tmp_path / "log.txt").write_text("6 1 0 0 15.0 0.3333\n")
    monkeypatch.setattr("antdrive.cli.warming.is_warm", lambda: True)
    (tmp_path / ".cache").mkdir()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / ".cache"))  # of calibrated margins, too
    monkeypatch.setattr(version, "_physics", dict)
    monkeypatch.setitem(sys.modules, "pybullet", None)
    return tmp_path


def test_every_command_is_here():
    every = {*COMMANDS, *(f"worlds {name}" for name in WORLDS), *(f"robots {name}" for name in ROBOTS)}
    assert {*WORKS, *REFUSES, "reproduce"} == every  # which only plans, for longer than a test
    assert {name for name, one in COMMANDS.items() if "drives" in one.marks} == set(REFUSES) - set(WORKS)


@pytest.mark.parametrize(("name", "words"), [(name, words) for name, each in WORKS.items() for words in each])
def test_a_command_that_needs_no_drive_works(folder, antdrive, name, words):
    code, _, err = antdrive(*name.split(), *words.split())
    assert MISSING not in err
    assert code == (1 if name == "barn" else 0), err  # a log with too few trials


@pytest.mark.parametrize(("name", "words"), REFUSES.items())
def test_a_command_that_drives_refuses_before_any_work(folder, antdrive, monkeypatch, name, words):
    monkeypatch.setattr("antdrive.sim.pipeline.compose", None)  # plans
    monkeypatch.setattr(Pool, "__enter__", None)
    before = sorted(folder.rglob("*"))
    code, out, err = antdrive(*name.split(), *words.split())
    assert (code, out, err.count("\n")) == (2, "", 1), err
    assert MISSING in err
    assert sorted(folder.rglob("*")) == before


def test_a_run_of_the_library_raises_the_line(folder, small_scenario):
    with pytest.raises(InputError, match=MISSING):
        run(small_scenario)


def test_a_finished_campaign_needs_no_physics(small, tmp_path, monkeypatch):
    campaign = {"schema": 1, "worlds": [str(small)], "planners": ["astar"], "seeds": 1}
    made = [sweep(campaign, tmp_path / "camp", jobs=0).made]
    monkeypatch.setattr(version, "_physics", dict)
    assert [*made, sweep(campaign, tmp_path / "camp", jobs=0).made] == [1, 0]


def test_warm_leaves_out_drives(folder, monkeypatch):
    groups = []
    monkeypatch.setattr(Pool, "results", lambda _, __, items, **___: groups.extend(items) or ())
    monkeypatch.setattr(warming, "_marker", lambda: folder / "warm")
    warming.warm(1)
    assert groups
    assert warming.drive not in groups
