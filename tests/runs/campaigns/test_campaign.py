"""What is wrong in a campaign is said in one line; what is right expands to every combination, each with a key of its own."""

import dataclasses
import hashlib
import itertools
import json
import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive import load_task
from antdrive.base.errors import InputError
from antdrive.planners import PLANNERS
from antdrive.robots import list_robots
from antdrive.runs.campaigns import campaign_schema, expand, load_campaign, make_campaign
from antdrive.runs.campaigns.resolving import values_of
from antdrive.runs.campaigns.rows import grid_row
from antdrive.sim.log.record import hashes_of
from antdrive.sim.pipeline import run
from antdrive.worlds import Disc, Task, World, save_task

HEAD = "schema: 1\nworlds: [empty]\nplanners: [astar]\n"


def expanded(text, folder):
    (folder / "c.yaml").write_text(text)
    jobs = expand(load_campaign(folder / "c.yaml")).jobs
    return [(job.case.place.world, job.case.place.name, job.case.planner.label, job.seed) for job in jobs]


#: What is wrong in a campaign; and below a head that is right.
WRONG = (
    "schema: 1\nplanners: [astar]\n", "schema: 1\nworlds: []\nplanners: [astar]\n",
    "schema: 1\nworlds: [emty]\nplanners: [astar]\n", "schema: 1\nworlds: [empty]\nplanners: [astr]\n",
    "schema: 1\nworlds: [empty]\nplanners:\n  - {name: as, ants: {from: .nan, to: 50, step: 10}}\n",
    "schema: 1\nworlds:\n  - {generate: forst, seeds: 2}\nplanners: [astar]\n",
    "schema: 1\nworlds: [empty]\nplanners:\n  - {name: as, ants: [10, many]}\n",
    "schema: 1\nworlds: [empty]\nplanners:\n  - {name: as, ants: {from: 10, to: 50}}\n",
    "schema: 1\nworlds: [empty]\nplanners:\n  - {ants: 10}\n",
)  # fmt: skip
WRONG_BELOW_THE_HEAD = (
    "planers: [astar]", "cell: 0.1", "seeds: 0", "seeds: [1, 1]", "seeds: many", "smoothing: [tout]", "noise: [-1]",
    "noise: 1000", "margin: wide", "robots: jakal", "rollouts: some", "tasks: twice", "tasks:\n  random: 0",
    "tasks: {random: 2, min_distance: 99}", "tasks:\n  - {start: [1, 1, 0]}",
    "tasks:\n  - {start: [1, 1, 0], goal: [99, 1]}", "settings: {cell: []}", "settings: {cell: [0.1, 0]}",
    "settings: {physics_hz: 20}", "settings: {controller: {lokahead: 1.0}}",
)  # fmt: skip
#: Files that hold no planner `Mine`.
WRONG_PLANNERS = ("", "class Other: ...", "class Mine: ...", "1 / 0", "raise SystemExit(3)")


def test_lists_and_ranges_of_options_are_multiplied_in_the_order_of_the_file(tmp_path):
    text = (
        "schema: 1\nworlds: [gate, empty]\nseeds: [3, 1]\nplanners:\n"
        "  - astar\n  - {name: as, ants: {from: 10, to: 30, step: 10}, beta: [1.0, 2.0]}\n"
    )
    planners = ["astar", *(f"as ants={n} beta={b}" for n, b in itertools.product((10, 20, 30), (1.0, 2.0)))]
    assert expanded(text, tmp_path) == [
        (world, "own", planner, seed) for world in ("gate", "empty") for planner in planners for seed in (3, 1)
    ]


def test_combinations_that_mean_the_same_are_run_once():
    same = PLANNERS["as"].ants
    expansion = expand(make_campaign({"worlds": ["empty"], "planners": ["as", {"name": "as", "ants": same}]}))
    assert [job.case.planner.label for job in expansion.jobs] == ["as"]
    assert expansion.duplicates == 1


@given(st.integers(-50, 50), st.integers(0, 300), st.integers(1, 20))
def test_a_range_goes_from_its_first_number_to_its_last(first, width, step):
    campaign = make_campaign({"worlds": ["empty"], "planners": ["astar"]})
    whole = values_of(campaign, (), {"from": first, "to": first + width, "step": step})
    assert whole == list(range(first, first + width + 1, step))
    tenths = values_of(campaign, (), {"from": first / 10, "to": (first + width) / 10, "step": step / 10})
    assert [round(10 * value) for value in tenths] == whole


def test_everything_that_a_run_depends_on_changes_its_key_and_names_do_not(tmp_path):
    world = World("small", (0.0, 0.0, 4.0, 3.0), (Disc(2.0, 1.5, 0.3),))
    task = Task(world, (0.6, 1.4, 0.0), (3.4, 1.6), cell=0.2)
    for name, one in {
        "a": task,
        "renamed": dataclasses.replace(task, world=dataclasses.replace(world, name="b", source="elsewhere")),
        "nudged": dataclasses.replace(task, goal=(3.4, 1.6000001)),
    }.items():
        save_task(one, tmp_path / f"{name}.yaml")
    base = {"worlds": "a.yaml", "planners": {"name": "as", "ants": 10}}
    changes = [
        {"worlds": "nudged.yaml"}, {"planners": {"name": "as", "ants": 11}}, {"planners": "mmas"}, {"robots": "jackal"},
        {"seeds": [1]}, {"margin": 0.04}, {"margin": "auto"}, {"noise": 1}, {"smoothing": "taut"},
        {"settings": {"cell": 0.1}}, {"settings": {"controller": {"lookahead_time": 0.4}}},
        {"tasks": [{"start": [0.6, 1.4, 0.1], "goal": [3.4, 1.6]}]},
    ]  # fmt: skip

    def key(**changed):
        (job,) = expand(make_campaign({**base, **changed}, tmp_path)).jobs
        return job.key

    keys = [key(), *(key(**change) for change in changes)]
    assert len(set(keys)) == len(keys)
    assert all(len(one) == 32 for one in keys)
    assert key(worlds="renamed.yaml") == keys[0]


def test_the_key_of_a_run_is_the_same_tomorrow():
    (job,) = expand(make_campaign({"worlds": ["empty"], "planners": ["astar"]})).jobs
    assert "0x" not in job.case.resolved.identity, "an address would be another one in the next process"
    for name in PLANNERS:
        (job,) = expand(make_campaign({"worlds": ["empty"], "planners": [name]})).jobs
        assert "0x" not in job.case.resolved.identity
        json.loads(job.case.resolved.identity)


def test_the_hash_of_a_world_is_the_one_that_logs_are_bound_to():
    (job,) = expand(make_campaign({"worlds": ["empty"], "planners": ["astar"]})).jobs
    log = run(job.case.scenario(job.seed)).rollout
    assert job.case.world_hash == hashes_of(log.record)["world"]
    assert job.case.robot.content == hashes_of(log.record)["robot"]


def test_random_tasks_are_apart_the_same_in_any_campaign_and_named():
    tasks = {"random": 4, "seed": 5, "min_distance": 6.0}
    alone = expand(make_campaign({"worlds": ["slalom"], "planners": ["astar"], "tasks": tasks})).jobs
    among = expand(make_campaign({"worlds": ["empty", "slalom"], "planners": ["astar"], "tasks": tasks})).jobs
    assert [job.key for job in among[4:]] == [job.key for job in alone]
    assert [job.case.place.name for job in alone] == [f"random-5-{n}" for n in range(4)]
    for job in alone:
        task = job.case.place.task
        assert ((task.start[0] - task.goal[0]) ** 2 + (task.start[1] - task.goal[1]) ** 2) ** 0.5 >= 6.0
    assert len({job.case.place.task.start for job in alone}) == 4


def test_bad_problems_are_named_or_skipped(tmp_path):
    (tmp_path / "w.map").write_text("type octile\nheight 4\nwidth 5\nmap\n....@\n.....\n.....\n.....\n")
    ends = ((3, 0, 0, 3), (0, 3, 4, 3), (4, 0, 0, 0))  # beside a blocked cell, clear, on a blocked cell
    problems = ["\t".join(map(str, (0, "w.map", 5, 4, *one, 3))) for one in ends]
    (tmp_path / "w.map.scen").write_text("\n".join(["version 1", *problems]) + "\n")
    entry = {"import": "w.map", "problem": "0-2", "resolution": 0.4}

    def expanded(**more):
        return expand(make_campaign({"worlds": [entry | more], "planners": ["astar"]}, tmp_path))

    with pytest.raises(InputError, match=r"problem 2: .*blocked cell.*; with skip: true"):
        expanded()
    with pytest.raises(InputError, match=r"w, problem 0 with turtlebot: .*overlaps.*; with skip: true"):
        expanded(problem=0)
    expansion = expanded(skip=True)
    assert [job.case.place.name for job in expansion.jobs] == ["problem-1"]
    assert expansion.remarks[0].startswith("2 problems skipped; problem 2: ")
    with pytest.raises(InputError, match="every problem is skipped; the first: problem 2"):
        expanded(skip=True, problem=2)


def test_the_floor_of_random_tasks_is_stated():
    campaign = {"worlds": ["slalom", "empty"], "planners": ["astar"], "tasks": {"random": 1}}
    (remark,) = expand(make_campaign(campaign)).remarks
    assert re.match(r"random tasks are drawn from \d\d% \(world slalom\) to 100% of the connected floor", remark)


def test_random_tasks_on_a_map_server_map_need_no_ends_and_unknown_cells_are_stated(tmp_path):
    picture = np.full((40, 60), 254, dtype=np.uint8)
    picture[[0, -1]], picture[:, [0, -1]], picture[:, 20], picture[:, 21:30] = 0, 0, 0, 205
    (tmp_path / "w.pgm").write_bytes(b"P5\n60 40\n255\n" + picture.tobytes())
    keys = "image: w.pgm\nresolution: 0.1\norigin: [3, 4, 0.5]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
    (tmp_path / "w.yaml").write_text(keys)
    campaign = {"worlds": [{"import": "w.yaml"}], "planners": ["astar"], "tasks": {"random": 2}}
    expansion = expand(make_campaign(campaign, tmp_path))
    for job in expansion.jobs:
        assert all(3.0 < x < 5.9 for x in (job.case.place.task.start[0], job.case.place.task.goal[0]))
    assert expansion.remarks[0].startswith(
        "world w: 360 cells (15.00%) of shade 205, map savers' unknown, are taken for"
    )
    with pytest.raises(InputError, match="start and goal: missing"):
        expand(make_campaign(campaign | {"tasks": "own"}, tmp_path))


def test_random_tasks_on_a_map_need_no_problem_and_lie_on_its_largest_ground(tmp_path):
    block = 100  # cells; discs cover its rim and leave it hollow
    wide = "." * (block + 6)
    rows = (
        [wide] * 3
        + ["..." + "@" * block + "..."] * block
        + [wide] * 3
        + ["@" * (block + 6), "....." + "@" * (block + 1)]
    )
    text = "\n".join(["type octile", f"height {len(rows)}", f"width {block + 6}", "map", *rows])
    (tmp_path / "ring.map").write_text(text + "\n")
    campaign = {"worlds": [{"import": "ring.map"}], "planners": ["astar"], "tasks": {"random": 4}}
    expansion = expand(make_campaign(campaign, tmp_path))
    assert len(expansion.jobs) == 4 * len({job.seed for job in expansion.jobs})
    for job in expansion.jobs:
        task = job.case.place.task
        assert task.world.bounds == (0.0, 2.0, block + 6.0, block + 8.0)
        for x, y in (task.start[:2], task.goal):
            assert not (3 < x < block + 3 and 5 < y < block + 5), "not in the hollow"
    assert expansion.remarks == (
        "random tasks are drawn from 100% of the connected floor: where the largest robot gets with its margin, by its disc",
    )
    with pytest.raises(InputError, match="start and goal: missing"):
        expand(make_campaign(campaign | {"tasks": "own"}, tmp_path))


def test_a_map_without_ground_is_refused(tmp_path):
    (tmp_path / "w.map").write_text("type octile\nheight 1\nwidth 3\nmap\n.@.\n")
    campaign = {"worlds": [{"import": "w.map"}], "planners": ["astar"], "tasks": {"random": 1}}
    with pytest.raises(InputError, match=r"w\.map: map: has no two connected free cells"):
        expand(make_campaign(campaign, tmp_path))


def test_the_floor_counts_only_where_the_largest_robot_gets(tmp_path):
    rooms = [Disc(5.0, y, 0.5) for y in (0.5, 1.5, 2.5, 3.5)]  # a passage of 0.3 m between two rooms
    task = Task(World("rooms", (0.0, 0.0, 10.0, 4.3), tuple(rooms)), (1.0, 1.0, 0.0), (3.0, 2.0))
    save_task(task, tmp_path / "rooms.yaml")
    campaign = {"worlds": ["rooms.yaml"], "planners": ["astar"], "tasks": {"random": 1}}
    (remark,) = expand(make_campaign(campaign, tmp_path)).remarks
    share = int(re.search(r"(\d+)%", remark)[1])
    assert 30 <= share < 50, "one room of two"


def test_random_tasks_of_a_planner_that_knows_no_headings_among_movers_are_drawn_for_the_disc():
    worlds = ["people-doorway", "office"]
    campaign = {"worlds": worlds, "planners": ["mmas-dstar"], "robots": ["warehouse"], "tasks": {"random": 12}}
    expansion = expand(make_campaign(campaign))
    assert expansion.remarks[0].endswith("by its disc or by footprint (warehouse)")
    tasks = [job.case.place.task for job in expansion.jobs if job.case.place.world == "people-doorway"]
    assert not any((task.start[0] < 6) != (task.goal[0] < 6) for task in tasks), "a disc of 0.7 m closes the door"


@pytest.mark.parametrize(
    ("planners", "robots", "more", "how"),
    [
        (["astar"], ["warehouse"], {}, "by footprint (warehouse)"),
        (["astar"], ["warehouse", "turtlebot"], {}, "by footprint (warehouse)"),
        (["astar"], ["warehouse"], {"footprint": "disc"}, "by its disc"),
        (["astar", "tangent"], ["warehouse"], {}, "by its disc"),
        (["astar"], ["turtlebot"], {}, "by its disc"),
    ],
)
def test_random_tasks_are_drawn_from_what_robots_reach_by_the_shape_of_their_plans(
    planners, robots, more, how, tmp_path
):
    rooms = [Disc(5.0, y / 10, 0.05) for y in range(50) if not 20 < y < 30]  # a passage of 0.9 m between two rooms
    task = Task(World("rooms", (0.0, 0.0, 10.0, 5.0), tuple(rooms)), (1.5, 2.5, 0.0), (8.0, 2.5), cell=0.1)
    save_task(task, tmp_path / "rooms.yaml")
    campaign = {"worlds": ["rooms.yaml"], "planners": planners, "robots": robots, "tasks": {"random": 12}}
    expansion = expand(make_campaign(campaign | {"settings": more}, tmp_path))
    tasks = [job.case.place.task for job in expansion.jobs]
    through = any((task.start[0] < 5) != (task.goal[0] < 5) for task in tasks)
    by_disc = how == "by its disc" and "warehouse" in robots
    assert through != by_disc, "a disc of 0.7 m closes the passage"
    assert expansion.remarks[0].endswith(how)
    share = int(re.search(r"(\d+)%", expansion.remarks[0])[1])
    assert (share < 60) == by_disc


def test_worlds_of_one_name_are_called_by_their_files(tmp_path):
    for folder in ("a", "b"):
        task = dataclasses.replace(load_task("empty"), start=(1.0, 1.0 + (folder == "b"), 0.0))
        save_task(task, tmp_path / folder / "w.yaml")
    campaign = make_campaign({"worlds": ["*/w.yaml", "a/w.yaml"], "planners": ["astar"]}, tmp_path)
    assert [job.case.place.world for job in expand(campaign).jobs] == ["empty", "b/w.yaml"]


def test_lists_of_settings_are_multiplied_and_stand_in_columns():
    settings = {
        "cell": [0.1, 0.2], "time_limit": 60, "sees": ["velocities", "positions:3"],
        "controller": {"lookahead_time": [0.4, 0.5], "lookahead_min": 0.2}, "avoid": [True, False],
        "unseen": [[{"x": 3.0, "y": 3.0, "radius": 0.2}], []],
    }  # fmt: skip
    jobs = expand(make_campaign({"worlds": ["empty"], "planners": ["astar"], "settings": settings})).jobs
    rows = [grid_row(job) for job in jobs]
    assert len({job.key for job in jobs}) == len(jobs) == 2 * 2 * 2 * 2 * 2
    seen = [{row[name] for row in rows} for name in ("cell", "time_limit", "sees", "controller", "avoid", "unseen")]
    assert seen == [
        {0.1, 0.2}, {60.0}, {"velocities", "positions:3"},
        {f"lookahead_time={s} lookahead_min=0.2" for s in (0.4, 0.5)}, {"default", "none"}, {"3,3,0.2", "none"},
    ]  # fmt: skip
    words = "--cell 0.2 --set controller.lookahead_time=0.5 --set controller.lookahead_min=0.2 --sees positions:3 --no-avoid"
    assert words in rows[-1]["command"]
    assert all(job.case.scenario(0).time_limit == 60 for job in jobs)


def test_robots_of_one_name_are_called_by_their_files(tmp_path):
    text = list_robots()["turtlebot"].read_text()
    for name, mass in (("a", 1), ("b", 2), ("c", 1)):
        (tmp_path / f"{name}.yaml").write_text(re.sub(r"(?m)^mass: ", f"mass: {mass}", text))
    campaign = {"worlds": ["empty"], "planners": ["astar"], "robots": ["a.yaml", "b.yaml", "c.yaml"]}
    rows = [grid_row(job) for job in expand(make_campaign(campaign, tmp_path)).jobs]
    assert [row["robot"] for row in rows] == ["turtlebot", "b.yaml"], "c is a again"
    assert len({row["robot_hash"] for row in rows}) == 2


def test_a_margin_stands_in_the_table_as_it_was_asked():
    campaign = {"worlds": ["empty"], "planners": ["astar"], "margin": [0, 0.04, "auto"]}
    rows = [grid_row(job) for job in expand(make_campaign(campaign)).jobs]
    assert [(row["margin_asked"], row["margin"]) for row in rows] == [("0.0", 0.0), ("0.04", 0.04), ("auto", None)]


MINE = """
from dataclasses import dataclass
from antdrive.planners import AStar
from beside import NOTHING

@dataclass(frozen=True)
class Mine(AStar):
    width: int = 3
"""


def test_a_planner_in_a_file_has_options_and_a_key_that_follows_the_file(tmp_path):
    (tmp_path / "beside.py").write_text("NOTHING = 0\n")
    campaign = {"worlds": ["empty"], "planners": [{"name": "mine.py:Mine", "width": [4, 5]}]}

    def rows():
        return [grid_row(job) for job in expand(make_campaign(campaign, tmp_path)).jobs]

    (tmp_path / "mine.py").write_text(MINE)
    first = rows()
    assert [row["planner"] for row in first] == ["Mine width=4", "Mine width=5"]
    hashed = hashlib.sha256(MINE.encode()).hexdigest()[:8]
    assert first[0]["planner_version"] == f"mine.py {hashed}"
    assert f"--planner planners/{hashed}/mine.py:Mine" in str(first[0]["command"])
    assert [row["key"] for row in rows()] == [row["key"] for row in first]
    (tmp_path / "mine.py").write_text(MINE + "# corrected\n")
    assert not {row["key"] for row in rows()} & {row["key"] for row in first}


def test_classes_of_one_name_in_two_files_are_two_planners(tmp_path):
    (tmp_path / "beside.py").write_text("NOTHING = 0\n")
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "mine.py").write_text(MINE.replace("from beside import NOTHING", f"FOLDER = {folder!r}"))
    campaign = make_campaign({"worlds": ["empty"], "planners": ["a/mine.py:Mine", "b/mine.py:Mine"]}, tmp_path)
    assert [job.case.planner.label for job in expand(campaign).jobs] == ["mine-Mine", "b-mine-Mine"]


MAP = "type octile\nheight 4\nwidth 6\nmap\n" + "......\n" * 4


def movingai(folder):
    lines = [f"0\tm.map\t6\t4\t{k}\t0\t5\t3\t{5 - k}.0" for k in range(5)]
    folder.mkdir(exist_ok=True)
    (folder / "m.map").write_text(MAP)
    (folder / "m.map.scen").write_text("\n".join(["version 1", *lines]) + "\n")


@pytest.mark.parametrize(
    "worlds",
    [
        [{"import": "a/m.map", "problem": "0-4"}],
        [{"import": "a/m.map", "problem": [0, 1, 2, 3, 4]}],
        [{"import": "a/m.map", "problem": k} for k in (0, 1, 2, 2, 3, 4)],
    ],
)
def test_problems_of_a_map_are_tasks_of_one_world(worlds, tmp_path):
    movingai(tmp_path / "a")
    expansion = expand(make_campaign({"worlds": worlds, "planners": ["astar"]}, tmp_path))
    assert [(job.case.place.world, job.case.place.name) for job in expansion.jobs] == [
        ("m", f"problem-{k}") for k in range(5)
    ]
    assert [job.case.place.task.start[0] for job in expansion.jobs] == [k + 0.5 for k in range(5)]
    assert {name: expansion.counts[name] for name in ("worlds", "tasks")} == {"worlds": 1, "tasks": 5}


def test_maps_and_tasks_of_one_name_all_have_names_of_their_own(tmp_path):
    movingai(tmp_path / "a")
    movingai(tmp_path / "b")
    (tmp_path / "b" / "m.map").write_text(MAP.replace("......", ".....@", 1))
    ends = [{"start": [x, 0.5, 0], "goal": [4.5, 2.5]} for x in (0.5, 1.5, 2.5)]
    maps = [{"import": f"{folder}/m.map", "problem": "1-2"} for folder in ("a", "b")]
    worlds = [*maps, *({"import": "a/m.map", **one} for one in ends)]
    expansion = expand(make_campaign({"worlds": worlds, "planners": ["astar"]}, tmp_path))
    assert [(job.case.place.world, job.case.place.name) for job in expansion.jobs] == [
        ("m", "problem-1"), ("m", "problem-2"), ("b/m.map#m", "problem-1"), ("b/m.map#m", "problem-2"), ("m", "own"),
        *((f"a/m.map#m start={x},0.5,0 goal=4.5,2.5", "own") for x in (1.5, 2.5)),
    ]  # fmt: skip
    assert expansion.counts["tasks in 4 worlds"] == 7


def test_a_map_that_changes_is_read_again(tmp_path):
    movingai(tmp_path)
    campaign = {"worlds": [{"import": "m.map", "problem": 0}], "planners": ["astar"]}
    (before,) = expand(make_campaign(campaign, tmp_path)).jobs
    scen = tmp_path / "m.map.scen"
    scen.write_text(scen.read_text().replace("\t0\t0\t5\t3", "\t1\t1\t5\t3", 1))
    (after,) = expand(make_campaign(campaign, tmp_path)).jobs
    assert before.key != after.key


def test_drawn_tasks_keep_clear_of_cylinders_that_nobody_knows_of():
    unseen = [{"x": x, "y": y, "radius": 0.5} for x in (1.0, 3.0, 5.0) for y in (1.0, 3.0, 5.0)]
    campaign = {"worlds": "empty", "planners": "astar", "tasks": {"random": 20}, "settings": {"unseen": unseen}}
    starts = [job.case.place.task.start[:2] for job in expand(make_campaign(campaign)).jobs]
    assert min(math.dist(start, (one["x"], one["y"])) for start in starts for one in unseen) > 0.5


def test_a_list_of_settings_is_a_list_of_grids():
    settings = [{"map": "given"}, {"map": "none", "localisation": "matching", "odometry": [0, 1, 5]}]
    campaign = make_campaign({"worlds": "empty", "planners": "astar", "robots": "jackal", "settings": settings})
    rows = [grid_row(job) for job in expand(campaign).jobs]
    assert [(row["map"], row["localisation"], row["odometry"]) for row in rows] == [
        ("given", "fixes", 1.0), ("none", "matching", 0.0), ("none", "matching", 1.0), ("none", "matching", 5.0)
    ]  # fmt: skip
    assert "--map none --localisation matching --odometry 5" in rows[-1]["command"]
    settings[1]["localisation"] = "gps"
    with pytest.raises(InputError, match=r"^campaign: settings\[1\]\.localisation: empty with jackal: unknown 'gps'"):
        expand(make_campaign({"worlds": "empty", "planners": "astar", "robots": "jackal", "settings": settings}))
    for wrong in ([], [1], "none"):
        with pytest.raises(InputError, match="settings: must be a mapping such as"):
            make_campaign({"worlds": "empty", "planners": "astar", "settings": wrong})


def test_errors_name_the_options_that_keys_come_from():
    data = {"worlds": "empty", "planners": "astar", "robots": "jackal", "seeds": [0]}
    options = {"map": "--map", "seeds": "--trials"}
    for settings in ({"map": "no"}, [{"map": "given"}, {"map": "no"}]):
        with pytest.raises(InputError, match=r"^--map: empty with jackal: unknown 'no'; choose from given, none$"):
            expand(make_campaign({**data, "settings": settings}, options=options))
    with pytest.raises(InputError, match="--trials: must be whole numbers"):
        make_campaign({**data, "seeds": [0.5]}, options=options)
    with pytest.raises(InputError, match=r"^campaign: settings\.cell: must be"):
        make_campaign({**data, "settings": {"cell": -1.0}}, options=options)


def test_runs_with_a_map_have_the_keys_that_they_always_had():
    data = {"worlds": "empty", "planners": "astar", "robots": "jackal"}
    (plain,) = expand(make_campaign(data)).jobs
    (said,) = expand(make_campaign({**data, "settings": {"map": "given", "localisation": "fixes"}})).jobs
    (other,) = expand(make_campaign({**data, "settings": {"map": "none"}})).jobs
    assert plain.key == said.key
    assert not {"map", "localisation", "odometry"} & set(json.loads(plain.case.resolved.identity)["settings"])
    assert other.key != plain.key


def test_keys_name_what_robots_perceive_of_movers():
    """Without a map movers are found by lidar unless the campaign says otherwise; a world without movers has its old key."""

    def keys(**settings):
        data = {"worlds": ["empty", "plaza-moving"], "planners": "astar", "robots": "jackal", "settings": settings}
        return {row["world"]: (row["key"], row["sees"]) for row in map(grid_row, expand(make_campaign(data)).jobs)}

    alone, told, watching = keys(map="none"), keys(map="none", sees="velocities"), keys(map="none", sees="lidar")
    assert alone == {"empty": told["empty"], "plaza-moving": watching["plaza-moving"]}
    assert [one[1] for one in alone.values()] == ["velocities", "lidar"]
    assert watching["empty"] != told["empty"]
    assert keys() == keys(sees="velocities")
    with pytest.raises(InputError, match="sees: plaza-moving with jackal: velocities: the pose drifts"):
        keys(map="none", localisation="odometry", sees="velocities")


def test_the_schema_names_every_key():
    schema = campaign_schema()
    keys = ("schema", "worlds", "planners", "robots", "seeds", "tasks", "settings", "rollouts")
    assert set(schema["properties"]) >= {*keys}
    one, several = schema["properties"]["settings"]["anyOf"]
    assert several["items"] == one
    cells = one["properties"]["cell"]["anyOf"]
    assert cells[1] == {"type": "array", "items": cells[0], "minItems": 1}
    assert "$ref" not in json.dumps(schema["properties"]["settings"])
    assert schema["required"] == ["schema", "worlds", "planners"]


def test_every_setting_of_the_schema_has_a_meaning():
    settings = campaign_schema()["properties"]["settings"]["anyOf"][0]["properties"]
    assert [key for key, one in settings.items() if not one.get("description")] == []


@pytest.mark.parametrize(
    ("planners", "smoothing", "driven"),
    [
        (["astar"], {}, ["clearance"]),
        ([{"name": "as", "ants": [5]}], {}, ["clearance"]),
        (["astar", "tangent"], {}, ["none"]),
        ([{"name": "as", "ants": [5, 6]}], {}, ["none"]),
        ([{"name": "as", "ants": {"from": 5, "to": 6, "step": 1}}], {}, ["none"]),
        (["astar", "tangent"], {"smoothing": "clearance"}, ["clearance"]),
    ],
)
def test_planners_under_comparison_drive_their_own_plans_unless_smoothing_is_given(planners, smoothing, driven):
    expansion = expand(make_campaign({"worlds": "empty", "planners": planners, **smoothing}))
    assert sorted({job.case.resolved.columns["smoothing"] for job in expansion.jobs}) == driven
