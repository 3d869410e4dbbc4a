"""MovingAI maps and problems: the format, and the searches against the benchmark's own figures."""

from __future__ import annotations

import math
import tarfile
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from antdrive.base import InputError
from antdrive.planners import Query, load_planner
from antdrive.worlds import (
    Grid,
    MapProblem,
    import_movingai_map,
    import_movingai_problems,
    import_movingai_task,
    rasterise,
)
from tools.shared_data import MOVINGAI

MAPS = ("AR0011SR", "Paris_1_256", "maze512-8-0", "random512-25-0")
SEARCHES = ("astar", "dijkstra", "dstar-lite", "dstar")

MAP = "type octile\nheight 2\nwidth 3\nmap\n.@T\nG.S\n"
PROBLEM = "0\tmaps/tiny.map\t3\t2\t0\t0\t1\t1\t1.41421"


def written(tmp_path: Path, content: str | bytes) -> Path:
    path = tmp_path / "made.map"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def refused(tmp_path: Path, read: object, content: str | bytes) -> str:
    path = written(tmp_path, content)
    with pytest.raises(InputError) as caught:
        read(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert "\n" not in message
    return message.removeprefix(str(path)).lstrip(":")


def test_the_last_line_of_a_map_is_row_0(tmp_path: Path) -> None:
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
def test_line_ends_and_the_order_of_the_header_do_not_matter(tmp_path: Path, content: str) -> None:
    assert import_movingai_map(written(tmp_path, content)).free.sum() == 4


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", "1: the header must be type, height, width and map, got ''"),
        ("type octile\nheight 2\nwidth 3\n", "has no line `map`"),
        (MAP.replace("octile", "tile"), "the type must be octile, got 'tile'"),
        (MAP.replace("type octile\n", ""), "the type must be octile, got 'none'"),
        (MAP.replace("height 2\n", ""), "has no height"),
        (MAP.replace("width 3", "width -3"), "the width must be a whole number above 0, got '-3'"),
        (MAP.replace("width 3", "width 3 4"), "3: the header must be"),
        (MAP.replace("width 3", "width 3\nwidth 3"), "4: the header must be"),
        (MAP.replace("height 2", "height 99999").replace("width 3", "width 99999"), "the limit is"),
        (MAP + "...\n", "must have 2 lines of cells, as its height says, got 3"),
        (MAP.replace("G.S\n", ""), "must have 2 lines of cells, as its height says, got 1"),
        (MAP.replace("G.S", "G.SS"), "6: must have 3 cells, as the width says, got 4"),
        (MAP.replace("G.S", "G.x"), "6: cell 3 must be one of . G S @ O T W, got 'x'"),
        (MAP.replace("G.S", "G.").encode() + b"\xff", "must have 2 lines"),
        (b"type octile\nheight 1\nwidth 1\nmap\n\xff\n", r"5: cell 1 must be one of . G S @ O T W, got '\\xff'"),
        (b"\x89PNG\r\n\x1a\n", "1: the header must be"),
    ],
)  # fmt: skip
def test_malformed_maps_get_a_message_of_one_line(tmp_path: Path, content: str | bytes, words: str) -> None:
    assert words in refused(tmp_path, import_movingai_map, content)


def test_problems_are_turned_into_our_cells(tmp_path: Path) -> None:
    path = written(tmp_path, f"version 1\n{PROBLEM}\n\n12\ta b\\tiny.map\t3\t2\t2\t0\t0\t1\t2\n")
    one, two = import_movingai_problems(path)
    assert one == MapProblem((1, 0), (0, 1), 1.41421, "1.41421", "tiny.map", 0)
    assert two == MapProblem((1, 2), (0, 0), 2.0, "2", "tiny.map", 12)
    spaced = written(tmp_path, f"version 1.0\r\n{PROBLEM}\r\n".replace("\t", " "))
    assert import_movingai_problems(spaced) == [one]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (PROBLEM + "\t7", "2: must be bucket, map, width, height, start x, y, goal x, y and length, got 10 values"),
        (PROBLEM.replace("\t1\t1\t", "\tx\t1\t"), "2: must hold whole numbers and a length"),
        (PROBLEM.replace("1.41421", "far"), "2: must hold whole numbers and a length"),
        (PROBLEM.replace("1.41421", "nan"), "2: the length must be a number that is not negative, got nan"),
        (PROBLEM.replace("1.41421", "-1"), "2: the length must be a number that is not negative, got -1"),
        (PROBLEM.replace("\t0\t0\t", "\t3\t0\t"), "2: the start (3, 0) is outside the map of width 3 and height 2"),
        (PROBLEM.replace("\t1\t1\t", "\t1\t2\t"), "2: the goal (1, 2) is outside the map of width 3 and height 2"),
    ],
)
def test_malformed_problems_get_a_message_of_one_line(tmp_path: Path, line: str, words: str) -> None:
    assert words in refused(tmp_path, import_movingai_problems, f"version 1\n{line}\n")


@pytest.mark.parametrize("content", ["", "version 2\n", PROBLEM])
def test_a_list_of_problems_begins_with_its_version(tmp_path: Path, content: str) -> None:
    assert "1: must be `version 1`" in refused(tmp_path, import_movingai_problems, content)


@pytest.mark.parametrize("read", [import_movingai_map, import_movingai_problems])
def test_files_that_cannot_be_read_are_named(tmp_path: Path, read: object) -> None:
    for path, words in ((tmp_path / "none.map", "no such file"), (tmp_path, "is a directory")):
        with pytest.raises(InputError, match=words):
            read(path)


def test_a_movingai_task_takes_a_problems_ends_at_the_centres_of_their_cells(tmp_path: Path) -> None:
    (tmp_path / "w.map").write_text("type octile\nheight 2\nwidth 3\nmap\n..@\n...\n")
    (tmp_path / "w.map.scen").write_text("version 1\n0\tw.map\t3\t2\t0\t0\t2\t1\t2.41421\n")
    task = import_movingai_task(tmp_path / "w.map", problem=0, resolution=2.0)
    assert (task.start, task.goal, task.cell) == ((1.0, 3.0, math.atan2(-1, 2)), (5.0, 1.0), 2.0)
    assert task.world.bounds == (0.0, 0.0, 6.0, 4.0)
    assert task.world.discs == pytest.approx(np.array([[5.0, 3.0, math.sqrt(2)]]))
    with pytest.raises(InputError, match=r"w\.map\.scen: has the problems 0 to 0, got 1"):
        import_movingai_task(tmp_path / "w.map", problem=1)
    with pytest.raises(InputError, match="problem: brings its own start and goal"):
        import_movingai_task(tmp_path / "w.map", problem=0, goal=(0.5, 0.5))
    with pytest.raises(InputError, match="resolution: must be greater than 0"):
        import_movingai_task(tmp_path / "w.map", problem=0, resolution=0.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if not MOVINGAI.exists():
        pytest.skip("needs the MovingAI maps (docs/how-to/data.md)")
    path = tmp_path_factory.mktemp("movingai")
    with tarfile.open(MOVINGAI) as tar:
        tar.extractall(path, filter="data")
    return path


@cache
def loaded(folder: Path, name: str) -> tuple[Grid, list[MapProblem]]:
    return import_movingai_map(folder / f"{name}.map"), import_movingai_problems(folder / f"{name}.map.scen")


def slack(name: str, problem: MapProblem) -> float:
    """How far the printed length may be from the true one: half its last digit, and the benchmark's float32 sums."""
    if name.startswith("Paris"):  # 8 decimals
        return 1e-6
    if name.startswith("AR"):  # 2 decimals
        return 0.005 + 1e-7 * problem.optimal
    return 0.5 * 10.0 ** (math.floor(math.log10(max(1.0, problem.optimal))) - 5) + 1e-7 * problem.optimal  # 6 digits


def check(name: str, search: str, grid: Grid, problems: list[MapProblem]) -> None:
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
def test_the_maps_are_read_whole(folder: Path, name: str, free: int, count: int) -> None:
    grid, problems = loaded(folder, name)
    assert grid.free.sum() == free
    assert len(problems) == count


@pytest.mark.parametrize("search", SEARCHES)
@pytest.mark.parametrize("name", MAPS)
def test_a_sample_of_printed_lengths_is_matched(folder: Path, name: str, search: str) -> None:
    """Problems spread evenly over the lengths."""
    grid, problems = loaded(folder, name)
    ordered = sorted(problems, key=lambda problem: problem.optimal)
    check(name, search, grid, ordered[:: len(ordered) // 20])


@pytest.mark.slow
@pytest.mark.parametrize("search", SEARCHES)
@pytest.mark.parametrize("name", MAPS)
def test_every_printed_length_is_matched(folder: Path, name: str, search: str) -> None:
    check(name, search, *loaded(folder, name))


@pytest.mark.parametrize("name", ["Paris_1_256", "AR0011SR"])
def test_worlds_of_discs_have_the_printed_lengths_too(folder: Path, name: str) -> None:
    """What discs reach beyond blocked cells leaves a robot of a quarter cell every move of the map."""
    problems = loaded(folder, name)[1]
    for number in range(50, len(problems), len(problems) // 4):
        task = import_movingai_task(folder / f"{name}.map", problem=number)
        assert len(task.world.obstacles) < 5300
        grid = rasterise(task.world, task.cell, 0.25)
        result = load_planner("dijkstra").plan(Query.between(grid, task), np.random.default_rng(0))
        assert abs(result.cost - problems[number].optimal) <= slack(name, problems[number])
