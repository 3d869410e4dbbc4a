"""What the command line says of wrong words, one line each: all of it is in `messages.yml`."""

import os
import re
import shlex
from pathlib import Path

import pytest

from antdrive.worlds import Disc, Task, World, save_task
from tests.worlds.malformed import MALFORMED

URDF = Path(__file__).parents[1] / "robots" / "importing" / "urdf"
#: Words of other libraries and of the system, which differ, and the ends of long lists.
FOREIGN = re.compile(r"(Invalid value for '[^']+'|cannot be written|choose (?:from|one of) (?:[^,]+, ){8}).*")

WORDS = r"""
barn .
check a.drive.yaml::
check a.drive.yaml::x
check b.drive.yaml
check small.yaml
compare camp --against astar --allow fun=1
compare camp --against astar --allow success
compare camp --against mmas
compare camp --allow success=0.1
compare camp --metric speed
compare camp --seed 3
compare camp --where noise
compare camp --where noise=2
compare camp -p astar
compare camp -p astar -p mmas
compare camp ./camp
compare camp forest
compare camp/parts -p astar
compare empty
compare empty -p a/b=astar -p ants
compare empty -p astar
compare empty -p astar -p ants --metric spl
compare empty -p astar -p ants --set astar.ants=3
compare empty -p astar -p ants --set mmas.ants=3
compare empty -p astar -p astar
compare empty -p planner=astar -p ants
compare empty empty -p astar -p ants
compare kamp
compare runs
compare slalon
compare tight.yaml -p astar -p dijkstra
demo --out small.yaml
export run.npz --to csv -o new --force
export run.npz --to csv -o new --urdf cart.urdf
export run.npz --to ros1 -o new --force
export run.npz --to csv -o new --namespace a
export run.npz --to csv -o new --start-time 1
export run.npz --to rosbag2 -o new --force
export run.npz -o new.mcap --namespace 1a
export run.npz -o new.mcap --namespace ''
export run.npz -o new.mcap --start-time -1
export run.npz -o new.mcap --arg a=1
falsify --method wise
falsify -p mine.py:Mine
falsify -p nobody
find-margin
find-margin --generate barn --goal 1,1
find-margin --generate desert
find-margin empty --generate barn
find-margin empty --goal 99,1
find-margin empty --task dock
init
init small.yaml
margin nothing.npz
margin runs
plan bad.yaml
plan office.yaml --goal 1,1 --frame robot
plan office.yaml --goal 9,9
plan tight.yaml -p astar
render nothing.npz -o f.mp4
render run.npz -o x.avi
render run.npz -o x.png --at 99
render run.npz -o x.mp4 --at 1
render run.npz -o x.mp4 --camera moon
render run.npz -o x.mp4 --size big
render run.npz run.npz -o x.png
report . -o r.md --against x
report . -o r.md --where x=2
report . -o r.pdf
report camp -o r.md --where x=2
report camp -o r.pdf
report camp . -o r.md
report nowhere -o r.html
reproduce lee2008 --out /proc/nowhere
reproduce nobody
robots import URDF/burger.urdf -o URDF/burger.urdf
robots import URDF/burger.urdf -o new.yaml --footprint star
robots import URDF/burger.urdf -o new.yaml --set colour=3
robots import URDF/burger.urdf -o new.yaml --set mass
robots import URDF/burger.urdf -o new.yaml --set mass=-3
robots import URDF/husky.urdf -o new.yaml --left rear_right_wheel --right rear_left_wheel
robots import URDF/none.urdf -o new.yaml
robots jackle
robots show jackal -o a.gif
robots show wharehouse
run emty
run empty --cell 1e-5
run empty --cell inf
run empty --cell nan
run empty --film film.avi
run empty --film folder.mp4
run empty --margin -1
run empty --margin AUTO
run empty --margin inf
run empty --margin nan
run empty --margin soon
run empty --noise 60
run empty --out /proc/nowhere
run empty --planner asta
run empty --robot jackel
run empty --sees all
run empty --sees positions:-1
run empty --sees positions:far
run empty --set ants=50
run empty --set controller.lookahead=1
run empty --set controller.lookahead_margin=7
run empty --set controller.lookahead_margin=abc
run empty --set controller.lookahead_max=1e9
run empty --set controller.lookahead_max=inf
run empty --set planner.ants
run empty --smoothing straight
run empty --time-limit inf
run empty --unseen 1,1,0.5 --unseen 3,3,0.5
run empty --unseen 1,2
run empty --unseen 1,2,-3
run empty --unseen 1e300,1,1
run empty -p aco-han --set planner.ant=50
run empty -p aco-han --set planner.ants=0
run empty -p aco-han --set planner.ants=many
run empty -p as --prelude 2
run empty -p astar --prelude 2 --film a.mp4
run office.yaml --start 0.1,1,0
run office.yaml --start 1,2
run office.yaml --task dok
run tight.yaml -p astar
schema moon
shrink a.drive.yaml::a -p own.py:Own
shrink nothing.npz
shrink run.npz
shrink run.npz --while 'clearance < 1'
shrink two.drive.yaml
shrink two.drive.yaml::a
sweep --world empty -p astar --tasks named --dry-run
sweep --world office.yaml -p astar --tasks 0 --dry-run
sweep --world office.yaml -p astar --tasks 3: --dry-run
sweep --world office.yaml -p astar --tasks 3:far --dry-run
sweep --world office.yaml -p astar --tasks many --dry-run
sweep --world office.yaml -p astar --tasks=-3 --dry-run
sweep -o out -p astar
sweep c.yaml
sweep c.yaml -o .
sweep c.yaml -o out/new --again x
sweep c.yaml -o out/a --dask host
sweep c.yaml -o out/b --dask local:0
sweep c.yaml -o out/new --dask local:2 -j 2
sweep c.yaml -o out/new --keep some
sweep c.yaml -o out/new --report a.md --dry-run
sweep c.yaml -o out/new --report all.doc
sweep c.yaml -o out/new --run-limit 0
sweep c.yaml -o out/new --seeds 1,b
sweep c.yaml -o out/new -p as --set as.ants
sweep c.yaml -o out/new --set as.ants=3
sweep c.yaml -o out/new -p as --set as.ants=1..x..2
sweep --world empty -p as --set planner.label=k -o out/new
sweep nowhere.yaml -o out
verify nothing.npz
verify runs
worlds export slalom -o /proc/nowhere/w.yaml
worlds export slalom -o w.map --resolution 0.0001
worlds export slalom -o w.map --resolution nan
worlds export slalom -o w.png
worlds export slalom -o w.sdf --resolution 1
worlds export small.yaml -o small.yaml
worlds export slaolm -o w.sdf
worlds generate desert -o new.yaml
worlds generate forest -o folder.mp4
worlds generate forest -o new.yaml --set count=1000
worlds generate forest -o new.yaml --set cuont=3
worlds import map.pgm -o new.yaml
worlds import map.txt -o new.yaml
worlds import made.map --start 0.5,0.5,0 --goal 2.5,0.5
worlds import made.map -o made.map --start 0.5,0.5,0 --goal 2.5,0.5
worlds import made.map -o new.yaml
worlds import made.map -o new.yaml --barn
worlds import made.map -o new.yaml --bounds 0,0,1,1
worlds import made.map -o new.yaml --problem 0
worlds import made.map -o new.yaml --start 0.5,0.5,0 --goal 2.5,0.5 --overhang 0.1
worlds import made.map -o new.yaml --start 0.5,0.5,0 --goal 2.5,0.5 --overhang nan
worlds import made.map -o new.yaml --start 0.5,0.5,0 --goal 2.5,0.5 --resolution nan
worlds import made.map -o new.yaml --start 0.5,0.5,0 --goal 2.5,0.5 --unknown free
worlds import none.map -o new.yaml
worlds import none.yaml -o new.yaml
worlds import nothing.json -o folder
worlds import nothing.world -o new.yaml
worlds import w.world -o new.yaml --band 2,1
worlds import w.map -o new.yaml --band 0,1
worlds import w.yaml -o new.yaml
worlds import w.yaml -o new.yaml --resolution 1
worlds import w.yaml -o new.yaml --unknown perhaps
worlds import x.json -o folder --goal 1,2
worlds import x.world -o new.yaml --barn --goal 1,2
worlds show tight.yaml --margin auto
"""


@pytest.fixture
def workplace(small, camp, office, small_run, tmp_path):
    """A folder with files that commands may name."""
    small_run.rollout.save(tmp_path / "run.npz")
    save_task(Task(World("tight", (0, 0, 6, 4), (Disc(2.5, 1.8, 0.4),)), (3, 2, 0), (5.3, 2)), tmp_path / "tight.yaml")
    for name, text in {
        "a.drive.yaml": "schema: 1\ndefaults: {planner: astar, world: small.yaml}\nscenarios: {clear: {seeds: [0, 1]}}\n",
        "two.drive.yaml": "{schema: 1, scenarios: {a: {world: empty, seeds: [0, 1]}}}",
        "c.yaml": "schema: 1\nworlds: [small.yaml]\nplanners: [astar, {name: aco-han, ants: [5, 10]}]\n",
        "bad.yaml": str(MALFORMED["misspelt key inside"]),
        "made.map": "type octile\nheight 2\nwidth 3\nmap\n.@.\n...\n",
        "made.yaml": "",
        "w.yaml": "schema: 1\n",
        "world.yaml": "",
    }.items():
        (tmp_path / name).write_text(text)
    for name in ("runs", "folder.mp4"):
        (tmp_path / name).mkdir()
    return tmp_path


def test_wrong_words_are_one_line_with_exit_code_2_and_nothing_is_written(refused, workplace, data_regression):
    there = sorted(workplace.rglob("*"))
    said = {}
    for line in WORDS.split("\n")[1:-1]:
        message = refused(*shlex.split(line.replace("URDF", str(URDF)))).removeprefix("antdrive: ").rstrip("\n")
        for folder, name in ((URDF, "URDF"), (workplace, "HERE"), (os.path.relpath(URDF), "URDF")):
            message = message.replace(str(folder), name)
        said[line] = FOREIGN.sub(r"\1...", message)
        assert sorted(path for path in workplace.rglob("*") if "out" not in path.parts) == there, line
    assert not (workplace / "out" / "barn").exists()
    data_regression.check(said, basename="messages")
