"""Outputs that cannot be written: one line that names the file, what is done is kept, and no empty folder stays."""

import errno
import json
import os
import shutil
import sys
import tarfile
from pathlib import Path

import pytest

from antdrive.base import InputError
from antdrive.cli.commands import COMMANDS, ROBOTS, WORLDS
from antdrive.cli.groups import exit_code_of
from antdrive.runs.failures import hunt
from antdrive.views.film import video
from antdrive.views.run_folder import write_run

#: Invalid input of every command that writes; OUT is a file in a folder that is missing.
INVALID = [
    "run empty -p nosuch -o OUT",
    "run empty --film OUT.doc",
    "run empty --prelude 2 -o OUT",
    "run empty --map none --robot husky -o OUT",
    "plan empty -p nosuch -o OUT",
    "plan nowhere -o OUT",
    "compare empty -p astar -p nosuch -o OUT",
    "compare empty -p astar -p as --film OUT.doc",
    "sweep --world empty -p astar -o OUT --again nosuch",
    "sweep --world empty -p astar -o OUT --jobs -1",
    "sweep --world empty -p astar -o OUT --report OUT.doc",
    "sweep --world empty -p astar -o OUT --dask nowhere",
    "sweep --world empty -p nosuch -o OUT",
    "barn nowhere -o OUT",
    "barn worlds.tar.gz -p nosuch -o OUT",
    "barn worlds.tar.gz -r nosuch -o OUT",
    "falsify --method wise",
    "demo --out OUT --jobs 1",
    "init OUT/robot.yaml --wise",
    "falsify -p nosuch -o OUT",
    "shrink nowhere -o OUT",
    "reproduce nosuch -o OUT",
    "check nowhere.drive.yaml -o OUT",
    "view nowhere -o OUT.html",
    "view drive drive drive drive drive -o OUT.html",
    "view drive --label one --label two -o OUT.html",
    "render nowhere -o OUT.mp4",
    "render drive -o OUT.doc",
    "render drive --camera wise -o OUT.mp4",
    "report nowhere -o OUT.html",
    "report drive -o OUT.doc",
    "export nowhere -o OUT.mcap",
    "export drive --to wise -o OUT",
    "certify nowhere.csv --map empty -o OUT",
    "certify track.csv --map empty --film OUT.doc",
    "certify track.csv --map empty --export OUT.doc",
    "certify track.csv --map empty --init OUT.yaml",
    "worlds generate wood -o OUT.yaml",
    "worlds import nowhere.sdf -o OUT.yaml",
    "worlds import wrong.map -o OUT.yaml",
    "worlds export nowhere -o OUT.sdf",
    "worlds export empty -o OUT.doc",
    "worlds show nowhere -o OUT.png",
    "worlds show empty -o OUT.doc",
    "robots import nowhere.urdf -o OUT.yaml",
    "robots show nowhere -o OUT.png",
    "robots show turtlebot -o OUT.doc",
]
#: Calls of every command that writes. OUT is a path that cannot be made: a file stands where its folder should be.
WRITING = [
    "run empty --no-figures -o OUT",
    "run empty --no-figures -o drive --film OUT.mp4",
    "plan empty -p astar -o OUT",
    "compare empty -p astar -p as --no-figures -o OUT",
    "sweep --world empty -p astar -o OUT --jobs 1",
    "falsify --budget 1 -o OUT",
    "shrink drive -o OUT",
    "reproduce lee2008 --quick -o OUT",
    "view drive -o OUT.html",
    "render drive -o OUT.png",
    "report drive -o OUT.html",
    "export drive -o OUT.mcap",
    "certify track.csv --map empty -o OUT",
    "certify track.csv --map empty --film OUT.mp4",
    "certify track.csv --map empty --export OUT.mcap",
    "certify track.csv --map empty --init OUT.drive.yaml",
    "export drive --to csv -o OUT",
    "worlds generate forest -o OUT.yaml",
    "worlds export empty -o OUT.sdf",
    "worlds export empty -o OUT.yaml",
    "worlds show empty -o OUT.png",
    "worlds import world.sdf -o OUT.yaml",
    "robots show turtlebot -o OUT.png",
]


def test_every_command_that_takes_an_output_is_called():
    takes_none = {"controller", "verify", "margin", "find-margin", "planners", "schema", "warm", "accept"}
    words = {*COMMANDS, *(f"worlds {name}" for name in WORLDS), *(f"robots {name}" for name in ROBOTS)}
    called = {line for line in INVALID for word in words if line.startswith(f"{word} ")}
    assert len(called) == len(INVALID)
    first = {line.split(" ")[0] for line in INVALID}
    assert {word for word in COMMANDS if word not in first} == takes_none


@pytest.fixture(scope="module")
def made(small_run, tmp_path_factory):
    """A folder with a drive, an archive of worlds and a broken map."""
    folder = tmp_path_factory.mktemp("made")
    write_run(small_run, folder / "drive", "antdrive run", formats=None)
    (folder / "wrong.map").write_text("type octile\n")
    (folder / "track.csv").write_text("t,x,y,yaw\n0,1,1,0\n0.1,1.02,1,0\n")
    assert exit_code_of(["worlds", "export", "empty", "-o", str(folder / "world.sdf")]) == 0
    (folder / "world_0.world").write_bytes((folder / "world.sdf").read_bytes())
    with tarfile.open(folder / "worlds.tar.gz", "w:gz") as archive:
        archive.add(folder / "world_0.world", "world_0.world")
    return folder


@pytest.fixture
def inputs(made, tmp_path):
    """The same in the folder of a test."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    return tmp_path


def files_in(folder):
    return sorted(str(path) for path in folder.rglob("*"))


@pytest.mark.parametrize("line", INVALID)
def test_invalid_input_leaves_no_folder(refused, inputs, line):
    before = files_in(inputs)
    refused(*line.replace("OUT", "new/folder/out").split())
    assert files_in(inputs) == before


@pytest.mark.parametrize("line", WRITING)
def test_an_output_that_cannot_be_made_is_named(refused, inputs, line):
    (inputs / "file").touch()
    before = files_in(inputs)
    said = refused(*line.replace("OUT", "file/out").split())
    assert said.startswith("antdrive: file"), said
    assert files_in(inputs) == before


@pytest.fixture
def limited(antdrive, monkeypatch):
    """Call `antdrive` while files hold at most 8 kB. It writes no bytecode, which the limit would cut short."""
    resource = pytest.importorskip("resource")
    monkeypatch.setattr(sys, "dont_write_bytecode", True)

    def call(*words):
        _, most = before = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (8192, most))
        try:
            return antdrive(*words)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)

    return call


def test_a_log_that_does_not_fit_leaves_no_folder(limited, small, tmp_path):
    out = tmp_path / "new" / "r"
    said = f"antdrive: {out / 'rollout.npz'}: cannot be written (File too large)\n"
    assert limited("run", small, "--no-figures", "-o", out) == (2, "", said)
    assert not (tmp_path / "new").exists()


def test_a_second_run_that_does_not_fit_leaves_the_first(limited, antdrive, small):
    antdrive("run", small, "--no-figures", "-o", "r")
    before = {path.name: path.read_bytes() for path in Path("r").iterdir()}
    assert limited("run", small, "-o", "r")[0] == 2
    assert {path.name: path.read_bytes() for path in Path("r").iterdir()} == before


SAVED = "; saved: r/result.json, r/rollout.npz, r/drive.html\n"


@pytest.mark.parametrize("view", ["film", "figure"])
def test_a_finished_drive_stays_without_space_for_its_views(refused, antdrive, small, monkeypatch, view):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    if view == "film":
        monkeypatch.setattr(video, "_write_all", full)
        said = refused("run", small, "--no-figures", "-o", "r", "--film", "r/film.mp4")
        assert said == "antdrive: r/film.mp4: cannot be written (No space left on device)" + SAVED
    else:
        monkeypatch.setattr("matplotlib.figure.Figure.savefig", full)
        said = refused("run", small, "-o", "r")
        assert said == "antdrive: r/overview.png: cannot be written (No space left on device)" + SAVED
    assert sorted(path.name for path in Path("r").iterdir()) == ["drive.html", "result.json", "rollout.npz"]
    facts = json.loads(Path("r/result.json").read_text())
    assert facts["files"] == {"result": "r/result.json", "rollout": "r/rollout.npz", "page": "r/drive.html"}
    assert antdrive("verify", "r")[0] == 0


def test_a_log_without_space_for_its_result_is_named(refused, small, monkeypatch):
    def full(path, value):
        raise InputError(f"{path}: cannot be written (No space left on device)")

    monkeypatch.setattr("antdrive.views.run_folder.write_json", full)
    said = refused("run", small, "--no-figures", "-o", "r")
    assert said == "antdrive: r/result.json: cannot be written (No space left on device); saved: r/rollout.npz\n"


def test_an_encoder_that_dies_names_the_film(refused, small, monkeypatch):
    monkeypatch.setattr(video, "ENCODERS", {".mp4": ("-c:v", "nosuch")})
    said = refused("run", small, "--no-figures", "-o", "r", "--film", "r/film.mp4")
    assert said.startswith("antdrive: r/film.mp4: cannot be written (ffmpeg failed to write the film (")


def test_a_search_that_fails_before_its_first_run_leaves_no_folder(refused, monkeypatch, tmp_path):
    monkeypatch.setattr(hunt, "TRIES", 0)
    assert "no world of 10 cylinders" in refused("falsify", "--budget", "1", "-o", "new/f")
    assert files_in(tmp_path) == []
