"""Planners by name: options, plugins, user code, and the other places that list planners."""

import hashlib
import importlib
import importlib.metadata
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import antdrive.planners
from antdrive import Scenario
from antdrive.base import InputError
from antdrive.planners import (
    PLANNERS,
    AcoHan,
    Capabilities,
    capabilities_of,
    describe,
    list_planners,
    load_planner,
    planner_version,
    record_name,
)
from antdrive.planners.iterative import INHERIT, without_iterations
from antdrive.planners.registry import recorded_planner
from antdrive.views.colours import PLANNER_STYLES
from tests.planners.worlds_to_solve import catalogue, optimum

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "plugin_planner"


class Site:
    """Put a directory of installed distributions on the path during a test."""

    def __init__(self, path):
        self.path = path

    def install(self, name, modules, entries):
        for module, source in modules.items():
            (self.path / f"{module}.py").write_text(source)
        info = self.path / f"{name.replace('-', '_')}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        lines = [f"{key} = {value}" for key, value in entries.items()]
        (info / "entry_points.txt").write_text("\n".join(["[antdrive.planners]", *lines, ""]))
        importlib.invalidate_caches()


@pytest.fixture
def site(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    before = set(sys.modules)
    yield Site(tmp_path)
    for name in set(sys.modules) - before:
        if str(tmp_path) in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]


def test_the_example_plugin_joins_through_its_entry_point(site):
    project = (EXAMPLE / "pyproject.toml").read_text()
    (name,) = re.findall(r'^name = "(.*)"$', project, re.MULTILINE)
    entries = dict(re.findall(r'"antdrive.planners"\]\n(\w+) = "(.*)"$', project, re.MULTILINE))
    source = (EXAMPLE / "wavefront.py").read_text()
    site.install(name, {"wavefront": source}, entries)

    assert "wavefront" in list_planners()
    digest = hashlib.sha256(source.encode()).hexdigest()[:8]
    assert planner_version("wavefront") == f"{name} 1.0 {digest}"
    query = catalogue()["slalom"]
    result = load_planner("wavefront").plan(query, np.random.default_rng(0))
    assert result.solved
    assert result.cost >= optimum(query) - 1e-9
    straight = load_planner("wavefront", straight="true").plan(query, np.random.default_rng(0))
    assert (np.abs(np.diff(straight.cells, axis=0)).sum(axis=1) == 1).all()
    with pytest.raises(InputError, match="option of wavefront"):
        load_planner("wavefront", strait="true")


def test_a_broken_plugin_is_named_and_omitted(site):
    site.install(
        "antdrive-broken", {"broken_ants": "raise RuntimeError('no licence')"}, {"broken": "broken_ants:Planner"}
    )
    with pytest.warns(UserWarning, match="'broken' of antdrive-broken cannot be loaded .*no licence"):
        known = list_planners()
    assert set(known) == set(PLANNERS)
    with pytest.raises(InputError, match="antdrive-broken cannot be loaded"):
        load_planner("broken")


def test_a_plugin_that_is_no_planner_is_refused(site):
    site.install("antdrive-odd", {"odd_ants": "thing = 3"}, {"odd": "odd_ants:thing"})
    with pytest.raises(InputError, match=r"antdrive-odd is not a planner .*plan\(query, rng\)"):
        load_planner("odd")


def test_a_plugin_cannot_take_a_built_in_name(site):
    site.install("antdrive-thief", {"thief": "raise AssertionError('must not load')"}, {"astar": "thief:AStar"})
    with pytest.warns(UserWarning, match="'astar' of antdrive-thief is omitted: antdrive already has that name"):
        assert list_planners()["astar"] is PLANNERS["astar"]
    assert load_planner("astar") is PLANNERS["astar"]


@pytest.mark.parametrize(
    ("options", "field", "value"),
    [
        ({"ants": "50"}, "ants", 50),
        ({"evaporation": "0.3"}, "evaporation", 0.3),
        ({"evaporation": 1}, "evaporation", 1.0),
        ({"max_steps": "none"}, "max_steps", None),
        ({"max_steps": "75"}, "max_steps", 75),
        ({"time_budget": "2.5"}, "time_budget", 2.5),
        ({"form": "listing"}, "form", "listing"),
    ],
)
def test_options_are_read_by_their_type(options, field, value):
    read = getattr(load_planner("aco-han", **options), field)
    assert read == value
    assert type(read) is type(value)


def test_every_planner_has_a_one_line_summary():
    for name, planner in PLANNERS.items():
        line = describe(planner)
        assert line.endswith("."), name
        assert len(line) <= 80 - len("aco-han-elite  "), f"{name}: longer than a line of `antdrive planners`"
    assert "elitism 100" in describe(PLANNERS["aco-han-elite"])
    assert describe(PLANNERS["aco-han"]) == describe(AcoHan())


def test_naming_planners_does_not_load_the_compiler():
    code = (
        "import sys; from antdrive.planners import list_planners, load_planner, describe; list_planners();"
        "load_planner('aco-han', ants=3); assert 'numba' not in sys.modules, 'numba was imported'"
    )
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)


# Other places that list planners


@pytest.mark.parametrize("name", PLANNERS)
def test_a_planner_has_a_line_style_of_its_own(name):
    assert name in PLANNER_STYLES, f"add {name} to views/colours.py"
    assert list(PLANNER_STYLES.values()).count(PLANNER_STYLES[name]) == 1


@pytest.mark.parametrize("name", PLANNERS)
def test_a_planner_s_class_is_exported_by_the_package(name):
    assert type(PLANNERS[name]).__name__ in antdrive.planners.__all__, "add it to planners/__init__.pyi"


@pytest.mark.parametrize("name", PLANNERS)
def test_a_planner_has_the_methods_that_it_declares(name):
    planner = PLANNERS[name]
    can = capabilities_of(planner)
    assert isinstance(can, Capabilities)
    assert can.iterative == hasattr(planner, "iterate")
    assert can.own_replanner == hasattr(planner, "replanner")
    assert can.cell_by_cell == hasattr(planner, "agent")


MINE = """
from dataclasses import dataclass
from antdrive.planners import AStar

@dataclass(frozen=True)
class Mine(AStar):
    width: int = 3
"""


RAISES = "def end(error):\n    raise error\n\nend({})\n"


@pytest.mark.parametrize("error", ["GeneratorExit()", "KeyboardInterrupt()", "BaseException('a\\nb')", "MemoryError()"])
def test_anything_raised_on_import_is_said_in_one_line(tmp_path, error):
    (tmp_path / "mine.py").write_text(RAISES.format(error))
    with pytest.raises(
        InputError, match=rf"mine.py: cannot be imported \({error.partition('(')[0]}.*, mine.py:2\)$"
    ) as said:
        load_planner(f"{tmp_path}/mine.py:Mine")
    assert str(said.value).isprintable()


WRONG = """
from dataclasses import dataclass
from antdrive.planners import GridPlanner
@dataclass{}
class Mine(GridPlanner):
    width: int
    def search(self, query, rng): ...
class Bare: ...
class Short:
    def plan(self, query): ...
class Ends:
    def __init__(self): raise GeneratorExit
    def plan(self, query, rng): ...
"""


@pytest.mark.parametrize(
    ("name", "frozen", "words"),
    [
        ("", True, r"mine.py names no class; write .*mine.py:CLASS; it has Mine, Short, Ends$"),
        (":", True, r"mine.py names no class; write .*mine.py:CLASS; it has Mine, Short, Ends$"),
        (":Mine", False, r"mine.py: Mine needs @dataclass\(frozen=True\), as its base class has \(mine.py:4\)"),
        (":Mine", True, r"mine.py:Mine' cannot be created: give all its options default values \(.*'width'\)"),
        (":Bare", True, r"it has no method plan\(query, rng\); write one, or inherit antdrive.planners.GridPlanner"),
        (":Short", True, r"its method must be plan\(query, rng\) \(too many positional arguments\)"),
        (":Ends", True, r"mine.py:Ends' cannot be loaded: GeneratorExit \(mine.py:12\)"),
    ],
)
def test_a_class_that_is_no_planner_is_told_what_to_write(tmp_path, name, frozen, words):
    (tmp_path / "mine.py").write_text(WRONG.format("(frozen=True)" if frozen else ""))
    with pytest.raises(InputError, match=words):
        load_planner(f"{tmp_path}/mine.py{name}")


UNDECLARED = """
from dataclasses import dataclass
from typing import ClassVar
from antdrive.planners import AntSystem
class Keeps(AntSystem):
    share: float = 0.5
class Few(AntSystem):
    ants = 30
class Plain(AntSystem):
    known: ClassVar[int] = 3
@dataclass(frozen=True, kw_only=True)
class Own(AntSystem):
    ants: int = 30
"""


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("Keeps", "the options of Keeps (share) need @dataclass(frozen=True, kw_only=True) above the class"),
        ("Few", "write `ants: int = 30`, and @dataclass(frozen=True, kw_only=True) above the class"),
    ],
)
def test_a_forgotten_decorator_or_type_is_named(tmp_path, name, problem):
    (tmp_path / "mine.py").write_text(UNDECLARED)
    with pytest.raises(InputError, match=re.escape(problem)):
        load_planner(f"{tmp_path}/mine.py:{name}")


def test_subclasses_of_ants_with_and_without_options_load(tmp_path):
    (tmp_path / "mine.py").write_text(UNDECLARED)
    assert load_planner(f"{tmp_path}/mine.py:Plain", ants=7).ants == 7
    assert load_planner(f"{tmp_path}/mine.py:Own").ants == 30


def test_a_class_that_is_loaded_is_found_by_its_name_in_records(tmp_path):
    (tmp_path / "mine.py").write_text(UNDECLARED)
    load_planner(f"{tmp_path}/mine.py:Own")
    assert recorded_planner("Own", ants=9).ants == 9
    assert recorded_planner("astar") is PLANNERS["astar"]


def test_only_planners_of_users_are_told_what_to_inherit_for_iterations(tmp_path):
    (tmp_path / "mine.py").write_text(MINE)
    mine = load_planner(f"{tmp_path}/mine.py:Mine")
    assert without_iterations(mine, "Mine") == f"Mine does not plan in iterations; {INHERIT}"
    assert without_iterations(PLANNERS["astar"], "astar") == "astar does not plan in iterations"


def test_a_file_is_read_again_when_it_has_changed(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(MINE)
    assert load_planner(f"{path}:Mine").width == 3
    assert load_planner(f"{path}:Mine", width="5").width == 5
    path.write_text(MINE.replace("3", "4"))
    assert load_planner(f"{path}:Mine").width == 4


def test_records_call_it_by_its_class(tmp_path):
    (tmp_path / "mine.py").write_text(MINE)
    assert Scenario.of("empty", f"{tmp_path}/mine.py:Mine").planner_label == "Mine"
    assert record_name("astar") == "astar"


def test_a_module_is_found_in_the_working_directory(tmp_path, monkeypatch):
    (tmp_path / "own_module_of_a_test.py").write_text(MINE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.path", ["elsewhere"])
    assert load_planner("own_module_of_a_test:Mine", width=7).width == 7
    digest = hashlib.sha256(MINE.encode()).hexdigest()[:8]
    assert planner_version("own_module_of_a_test:Mine") == f"own_module_of_a_test {digest}"


def test_a_module_that_is_taken_from_elsewhere_is_refused(tmp_path, monkeypatch):
    (tmp_path / "json.py").write_text(MINE)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(
        InputError, match=r"json is imported from .*, but another one exists in the working directory; rename it"
    ):
        load_planner("json:Mine")


def test_files_of_different_folders_have_modules_of_their_own(tmp_path):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "beside_own_code.py").write_text(f"WIDTH = {'ab'.index(folder)}\n")
        text = MINE.replace("= 3", "= beside_own_code.WIDTH").replace("\nfrom", "\nimport beside_own_code\nfrom", 1)
        (tmp_path / folder / "mine.py").write_text(text)
    widths = [load_planner(f"{tmp_path}/{folder}/mine.py:Mine").width for folder in "abab"]
    assert widths == [0, 1, 0, 1]


def test_the_version_of_a_planner_is_that_of_its_distribution():
    assert planner_version("astar") == f"antdrive {importlib.metadata.version('antdrive')}"


CODE = """
import dataclasses
import numpy as np
from antdrive.planners import PLANNERS, Query, capabilities_of, plan_in_time
from antdrive.worlds import Disc, Grid, Task, World, rasterise
free = np.ones((6, 7))
free[1:5, 3] = 0
bare = Query(Grid.from_free(free), (2, 1), (3, 5))
task = Task(World("w", (0, 0, 4, 3), (Disc(2, 1.5, 0.5), Disc(2.4, 1.9, 0.3))), (0.75, 1.25, 0), (3.25, 1.75))
query = Query.between(rasterise(task.world, 0.5, 0.1), task)
few = {"ants": 4, "iterations": 3, "population": 6, "ant_iterations": 2, "ant_runs": 1, "backtrack": True, "shortcut": True}
for name, planner in PLANNERS.items():
    known = {f.name for f in dataclasses.fields(planner)}
    planner = dataclasses.replace(planner, **{key: value for key, value in few.items() if key in known})
    for q in [query] if capabilities_of(planner).needs_world else [bare, query]:
        result = planner.plan(q, np.random.default_rng(0))
        print(name, result.status.name, round(result.line_length, 9), result.cells.tolist(), result.work)
class Mover:
    radius = 0.4
    def at(self, t):
        return np.column_stack([np.abs((t / 2 % 4) - 2) + 2, 0 * t])
result = plan_in_time(bare, [Mover()], speed=1.0)
print(result.status.name, result.arrive.round(9).tolist(), result.leave.round(9).tolist(), result.work)
"""


def printed(**environment):
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", CODE],
        cwd=Path(__file__).parents[2],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_uncompiled_kernels_give_the_same_plans_without_a_warning():
    plain = printed(NUMBA_DISABLE_JIT="1")
    assert plain.count("SOLVED") >= 2 * len(PLANNERS) - 4  # potentials and ants may get stuck
    assert plain == printed(NUMBA_DISABLE_JIT="0")
