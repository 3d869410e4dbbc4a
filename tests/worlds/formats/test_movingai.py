"""MovingAI maps and problems: the format, and the searches against the benchmark's own figures."""

import math
import tarfile
from functools import cache

import numpy as np
import pytest

from antdrive.base.errors import FieldError, InputError
from antdrive.planners import Query, load_planner
from antdrive.worlds import MapProblem, import_movingai_map, import_movingai_problems, import_movingai_task, rasterise
from tools.shared_data import MOVINGAI

MAPS = ("AR0011SR", "Paris_1_256", "maze512-8-0", "random512-25-0")
SEARCHES = ("astar", "dijkstra", "dstar-lite", "dstar")

MAP = "type octile\nheight 2\nwidth 3\nmap\n.@T\nG.S\n"
PROBLEM = "0\tmaps/tiny.map\t3\t2\t0\t0\t1\t1\t1.41421"


def written(tmp_path, content):
    path = tmp_path / "made.map"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def test_the_last_line_of_a_map_is_row_0(tmp_path):
    grid = import_movingai_map(written(tmp_path, MAP))
    np.testing.assert_array_equal(grid.free, [[True, True, True], [True, False, False]])
    assert grid.cell == 1.0
    assert grid.moves[0, 0] == 0b101  # east and north; the corner of (1, 1) is blocked


@pytest.mark.parametrize(
    "content",
    [
        MAP.replace("\n", "\r\n"),
        MAP.removesuffix("\n"),
        MAP + "\n\n",
        MAP.replace("height 2\nwidth 3", "width 3\nheight 2"),
        MAP.replace("type octile", "type  octile "),
    ],
)
def test_line_ends_and_the_order_of_the_header_do_not_matter(tmp_path, content):
    assert import_movingai_map(written(tmp_path, content)).free.sum() == 4


#: Maps that are wrong in one way each; `test_messages.yml` has what is said of them.
BAD_MAPS = (
    "", "type octile\nheight 2\nwidth 3\n", MAP.replace("octile", "tile"), MAP.replace("type octile\n", ""),
    MAP.replace("height 2\n", ""), MAP.replace("width 3", "width -3"), MAP.replace("width 3", "width 3 4"),
    MAP.replace("width 3", "width 3\nwidth 3"),
    MAP.replace("height 2", "height 99999").replace("width 3", "width 99999"), MAP + "...\n", MAP.replace("G.S\n", ""),
    MAP.replace("G.S", "G.SS"), MAP.replace("G.S", "G.x"), MAP.replace("G.S", "G.").encode() + b"\xff",
    b"type octile\nheight 1\nwidth 1\nmap\n\xff\n", b"\x89PNG\r\n\x1a\n",
)  # fmt: skip


def test_problems_are_turned_into_our_cells(tmp_path):
    path = written(tmp_path, f"version 1\n{PROBLEM}\n\n12\ta b\\tiny.map\t3\t2\t2\t0\t0\t1\t2\n")
    one, two = import_movingai_problems(path)
    assert one == MapProblem((1, 0), (0, 1), 1.41421, "1.41421", "tiny.map", 0)
    assert two == MapProblem((1, 2), (0, 0), 2.0, "2", "tiny.map", 12)
    spaced = written(tmp_path, f"version 1.0\r\n{PROBLEM}\r\n".replace("\t", " "))
    assert import_movingai_problems(spaced) == [one]


BAD_PROBLEMS = (
    PROBLEM + "\t7", PROBLEM.replace("\t1\t1\t", "\tx\t1\t"), PROBLEM.replace("1.41421", "far"),
    PROBLEM.replace("1.41421", "nan"), PROBLEM.replace("1.41421", "-1"), PROBLEM.replace("\t0\t0\t", "\t3\t0\t"),
    PROBLEM.replace("\t1\t1\t", "\t1\t2\t"),
)  # fmt: skip


def test_a_movingai_task_takes_a_problems_ends_at_the_centres_of_their_cells(tmp_path):
    (tmp_path / "w.map").write_text("type octile\nheight 2\nwidth 3\nmap\n..@\n...\n")
    (tmp_path / "w.map.scen").write_text("version 1\n0\tw.map\t3\t2\t0\t0\t2\t1\t2.41421\n")
    task = import_movingai_task(tmp_path / "w.map", problem=0, resolution=2.0)
    assert (task.start, task.goal, task.cell) == ((1.0, 3.0, math.atan2(-1, 2)), (5.0, 1.0), 2.0)
    assert task.world.bounds == (0.0, 0.0, 6.0, 4.0)
    assert task.world.discs == pytest.approx(np.array([[5.0, 3.0, math.sqrt(2)]]))


def test_a_problem_comes_from_the_only_scen_file_of_the_maps_name(tmp_path):
    """MAPF's benchmarks call theirs MAP-random-1.scen."""
    path, blocked = written(tmp_path, MAP), PROBLEM.replace("\t1\t1\t", "\t1\t0\t")
    for name in ("made-random-1.scen", "made-even-1.scen", "other-even-1.scen"):
        (tmp_path / name).write_text(f"version 1\n{PROBLEM}\n\n{blocked}\n")
    with pytest.raises(FieldError, match=r"scen: choose one of made-even-1\.scen, made-random-1\.scen"):
        import_movingai_task(path, problem=1)
    place = r"made-even-1\.scen: problem 1: the goal x = 1, y = 0 is on a blocked cell of made\.map"
    with pytest.raises(InputError, match=place):
        import_movingai_task(path, problem=1, scen=tmp_path / "made-even-1.scen")
    (tmp_path / "made-random-1.scen").unlink()
    with pytest.raises(InputError, match=place):
        import_movingai_task(path, problem=1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    if not MOVINGAI.exists():
        pytest.skip("needs the MovingAI maps (docs/how-to/data.md)")
    path = tmp_path_factory.mktemp("movingai")
    with tarfile.open(MOVINGAI) as tar:
        tar.extractall(path, filter="data")
    return path


@cache
def loaded(folder, name):
    return import_movingai_map(folder / f"{name}.map"), import_movingai_problems(folder / f"{name}.map.scen")


def slack(name, problem):
    """How far the printed length may be from the true one: half its last digit, and the benchmark's float32 sums."""
    if name.startswith("Paris"):  # 8 decimals
        return 1e-6
    if name.startswith("AR"):  # 2 decimals
        return 0.005 + 1e-7 * problem.optimal
    return 0.5 * 10.0 ** (math.floor(math.log10(max(1.0, problem.optimal))) - 5) + 1e-7 * problem.optimal  # 6 digits


def check(name, search, grid, problems):
    planner, rng = load_planner(search), np.random.default_rng(0)
    for problem in problems:
        assert problem.map_name == f"{name}.map"
        result = planner.plan(Query(grid, problem.start, problem.goal), rng)
        assert abs(result.cost - problem.optimal) <= slack(name, problem), problem


@pytest.mark.parametrize(
    ("name", "free", "count"),
    [
        ("AR0011SR", 120458, 1280),
        ("Paris_1_256", 47240, 1090),
        ("maze512-8-0", 232931, 6090),
        ("random512-25-0", 195313, 1840),
    ],
)
def test_the_maps_are_read_whole(folder, name, free, count):
    grid, problems = loaded(folder, name)
    assert grid.free.sum() == free
    assert len(problems) == count


@pytest.mark.parametrize("search", SEARCHES)
@pytest.mark.parametrize("name", MAPS)
def test_a_sample_of_printed_lengths_is_matched(folder, name, search):
    """Problems spread evenly over the lengths."""
    grid, problems = loaded(folder, name)
    ordered = sorted(problems, key=lambda problem: problem.optimal)
    check(name, search, grid, ordered[:: len(ordered) // 8])


@pytest.mark.slow
@pytest.mark.parametrize("name", MAPS)
def test_a_thousand_printed_lengths_are_matched(folder, name):
    """The searches take turns."""
    grid, problems = loaded(folder, name)
    some = problems[:: max(1, len(problems) // 800)]
    for turn, search in enumerate(SEARCHES):
        check(name, search, grid, some[turn :: len(SEARCHES)])


@pytest.mark.parametrize("name", ["Paris_1_256", "AR0011SR"])
def test_worlds_of_discs_have_the_printed_lengths_too(folder, name):
    """The overhang of discs leaves a robot of a quarter cell every move of the map."""
    problems = loaded(folder, name)[1]
    for number in range(50, len(problems), len(problems) // 2):
        task = import_movingai_task(folder / f"{name}.map", problem=number)
        assert len(task.world.obstacles) < 5300
        grid = rasterise(task.world, task.cell, 0.25)
        result = load_planner("dijkstra").plan(Query.between(grid, task), np.random.default_rng(0))
        assert abs(result.cost - problems[number].optimal) <= slack(name, problems[number])
