"""What a command says of a file that is a pipe, a folder, a device, empty or missing: one line, at once, with exit code 2."""

import os
import shlex
import shutil
from pathlib import Path

import pytest

from antdrive.cli.commands import COMMANDS, ROBOTS, WORLDS

#: Every way in which a command reads a file; FILE is the file in question.
READERS = {
    "run FILE": "w.yaml",
    "run empty -r FILE": "r.yaml",
    "run empty -p FILE:Mine": "mine.py",
    "plan FILE": "w.yaml",
    "plan empty -r FILE": "r.yaml",
    "compare FILE -p astar -p ants": "w.yaml",
    "sweep FILE -o new": "c.yaml",
    "sweep -w FILE -p astar -o new": "w.yaml",
    "sweep -w empty -p astar -r FILE -o new": "r.yaml",
    "sweep -w empty -p FILE:Mine -o new": "mine.py",
    "sweep campaign.yaml -o new": "camp/w.sdf",  # imported by the campaign
    "barn FILE": "worlds.tar.xz",
    "barn folder": "folder/worlds.tar.xz",
    "barn paths": "paths/path_1.npy",
    "view FILE -o new.html": "a.npz",
    "view runs -o new.html": "runs/rollout.npz",
    "render FILE -o new.mp4": "a.npz",
    "render runs -o new.mp4": "runs/rollout.npz",
    "report runs -o new.html": "runs/result.json",
    "report camp -o new.md": "camp/manifest.json",
    "report tables -o new.md": "tables/grid.parquet",
    "compare tables -p astar -p ants": "tables/grid.parquet",
    "export FILE --to csv -o new": "a.npz",
    "verify FILE": "a.npz",
    "certify FILE --map empty": "a.csv",
    "certify ./FILE --map empty": "a.mcap",
    "certify FILE --map empty --robot turtlebot": "a.bag",
    "certify table.csv --map FILE": "w.yaml",
    "plan empty -p FILE": "p.csv",
    "plan empty -p ./FILE": "p.geojson",
    "run empty -p FILE": "p.mcap",
    "verify runs --world FILE": "w.yaml",
    "check FILE": "a.drive.yaml",
    "accept FILE": "a.drive.yaml",
    "margin FILE": "a.npz",
    "find-margin FILE": "w.yaml",
    "falsify -r FILE": "r.yaml",
    "falsify -p FILE:Mine": "mine.py",
    "shrink FILE": "a.npz",
    "shrink FILE::a": "a.drive.yaml",
    "worlds show FILE": "w.yaml",
    "worlds show empty --robot FILE": "r.yaml",
    "worlds import FILE -o new.yaml": "w.sdf",
    "worlds import FILE -o new.yaml --barn": "w.world",
    "worlds import FILE -o new.yaml --start 1,1,0 --goal 2,2": "w.map",
    "worlds import scenes.map -o new.yaml --problem 0": "scenes.scen",
    "worlds import ./FILE -o new.yaml --start 1,1,0 --goal 2,2": "m.yaml",
    "worlds import map.yaml -o new.yaml --start 1,1,0 --goal 2,2": "map.pgm",  # its image
    "worlds import FILE -o new": "set.json",
    "worlds export FILE -o new.sdf": "w.yaml",
    "robots show FILE": "r.yaml",
    "robots import FILE -o new.yaml": "r.urdf",
    "robots import ./FILE -o new.yaml": "r.xacro",
    "robots import stl.urdf -o new.yaml": "body.stl",  # its mesh
    "robots import obj.urdf -o new.yaml": "body.obj",
    "robots import dae.urdf -o new.yaml": "body.dae",
}
#: Commands that read no file of the user.
NO_FILES = {
    "planners",
    "controller",
    "schema",
    "warm",
    "demo",
    "init",
    "reproduce",
    "worlds list",
    "worlds generate",
    "robots list",
    "robots print",
}
URDF = Path(__file__).parents[1] / "robots" / "importing" / "urdf" / "waffle.urdf"
AROUND = {
    "campaign.yaml": "schema: 1\nworlds: [{import: camp/w.sdf, start: [0, 0, 0], goal: [1, 1]}]\nplanners: [astar]\n",
    "scenes.map": "type octile\nheight 2\nwidth 3\nmap\n.@.\n...\n",
    "map.yaml": "image: map.pgm\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n",
    "tables/manifest.json": '{"size": 3}',
    "table.csv": "t,x,y,yaw\n0,1,1,0\n0.1,1.02,1,0\n",
    "paths/world_1.world": "<sdf version='1.6'><world name='w'/></sdf>",
    **{
        f"{kind}.urdf": URDF.read_text().replace(
            '<box size="0.281 0.306 0.119"/>', f'<mesh filename="file://body.{kind}"/>'
        )
        for kind in ("stl", "obj", "dae")
    },
}
KINDS = {
    "a pipe": os.mkfifo,
    "a folder": os.mkdir,
    "a device": lambda path: os.symlink("/dev/zero", path),
    "an empty file": lambda path: Path(path).touch(),
    "a secret": lambda path: os.symlink("/proc/self/mem", path),
    "a loop": lambda path: os.symlink(Path(path).name, path),
    "nothing": lambda path: None,
}


@pytest.fixture(scope="module")
def log(small_run, tmp_path_factory):
    return small_run.rollout.save(tmp_path_factory.mktemp("log") / "rollout.npz")


@pytest.fixture
def around(antdrive, tmp_path, log):
    """The files beside the one in question."""
    for folder in ("camp", "folder", "paths", "runs", "tables", "tables/parts"):
        (tmp_path / folder).mkdir()
    for name, text in AROUND.items():
        (tmp_path / name).write_text(text)
    return tmp_path


@pytest.mark.parametrize(
    ("words", "kind"),
    [
        (words, kind) for words in READERS for kind in KINDS if (words, kind) != ("barn paths", "nothing")
    ],  # no path is fine
)
def test_a_file_that_is_no_file_is_refused_in_one_line(antdrive, around, log, words, kind):
    name = READERS[words]
    if "--world" in words:
        shutil.copy(log, around / "runs" / "rollout.npz")
    KINDS[kind](around / name)
    there = sorted(around.rglob("*"))
    code, out, err = antdrive(*shlex.split(words.replace("FILE", name)))
    assert (code, out, err.count("\n")) == (2, "", 1), (code, out, err)
    assert "internal error" not in err
    assert "[Errno" not in err
    assert err[:-1].isprintable()
    assert sorted(around.rglob("*")) == there, "nothing is written"


def test_every_command_is_in_the_list():
    known = {*COMMANDS, *(f"worlds {name}" for name in WORLDS), *(f"robots {name}" for name in ROBOTS)}
    named = {" ".join(words.split()[: 2 if words.startswith(("worlds", "robots")) else 1]) for words in READERS}
    assert named | NO_FILES == known
