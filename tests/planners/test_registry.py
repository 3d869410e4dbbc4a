from __future__ import annotations

import hashlib
import importlib
import inspect
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import antdrive.planners
from antdrive.base import InputError
from antdrive.cli.warm import TOGETHER
from antdrive.planners import (
    PLANNERS,
    AcoHan,
    Capabilities,
    GridPlanner,
    PlanResult,
    Query,
    capabilities_of,
    describe,
    list_planners,
    load_planner,
    planner_version,
)
from antdrive.views.style import PLANNER_STYLES
from tests.planners.worlds_to_solve import catalogue, optimum

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "plugin_planner"


class Site:
    """A directory of installed distributions, on the path while a test runs."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def install(self, name: str, modules: dict[str, str], entries: dict[str, str]) -> None:
        for module, source in modules.items():
            (self.path / f"{module}.py").write_text(source)
        info = self.path / f"{name.replace('-', '_')}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        lines = [f"{key} = {value}" for key, value in entries.items()]
        (info / "entry_points.txt").write_text("\n".join(["[antdrive.planners]", *lines, ""]))
        importlib.invalidate_caches()


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Site]:
    monkeypatch.syspath_prepend(str(tmp_path))
    before = set(sys.modules)
    yield Site(tmp_path)
    for name in set(sys.modules) - before:
        if str(tmp_path) in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]


def test_the_example_plugin_joins_through_its_entry_point(site: Site) -> None:
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


def test_a_broken_plugin_is_named_and_left_out(site: Site) -> None:
    site.install(
        "antdrive-broken",
        {"broken_ants": "raise RuntimeError('no licence')"},
        {"broken": "broken_ants:Planner"},
    )
    with pytest.warns(UserWarning, match="'broken' of antdrive-broken cannot be loaded .*no licence"):
        known = list_planners()
    assert set(known) == set(PLANNERS)
    with pytest.raises(InputError, match="antdrive-broken cannot be loaded"):
        load_planner("broken")


def test_a_plugin_that_is_no_planner_is_refused(site: Site) -> None:
    site.install("antdrive-odd", {"odd_ants": "thing = 3"}, {"odd": "odd_ants:thing"})
    with pytest.raises(InputError, match=r"antdrive-odd is not a planner .*plan\(query, rng\)"):
        load_planner("odd")


def test_a_plugin_cannot_take_a_name_of_ours(site: Site) -> None:
    site.install("antdrive-thief", {"thief": "raise AssertionError('must not load')"}, {"astar": "thief:AStar"})
    with pytest.warns(UserWarning, match="'astar' of antdrive-thief is left out: antdrive has one of that name"):
        assert list_planners()["astar"] is PLANNERS["astar"]
    assert load_planner("astar") is PLANNERS["astar"]


def test_an_unknown_planner_is_answered_with_close_names() -> None:
    with pytest.raises(InputError, match=r"'aco_han'; did you mean aco-han .*choose from .*astar, dijkstra"):
        load_planner("aco_han")


def test_an_unknown_option_is_answered_with_the_options() -> None:
    with pytest.raises(InputError, match=r"planner\.antz: .*did you mean ants\? choose from ants, attraction"):
        load_planner("aco-han", antz=5)
    with pytest.raises(InputError, match=r"planner\.ants: no option of astar .* there are none"):
        load_planner("astar", ants=5)


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
def test_options_are_read_by_their_type(options: dict[str, object], field: str, value: object) -> None:
    read = getattr(load_planner("aco-han", **options), field)
    assert read == value
    assert type(read) is type(value)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"ants": "many"}, "planner.ants: must be a whole number, got 'many'"),
        ({"ants": 2.5}, "planner.ants: must be a whole number, got 2.5"),
        ({"ants": True}, "planner.ants: must be a whole number, got True"),
        ({"ants": "0"}, "planner.ants: must be at least 1 and at most 1000000, got 0"),
        ({"evaporation": "nan"}, "planner.evaporation: must be a finite number, got 'nan'"),
        ({"evaporation": "1.5"}, "planner.evaporation: must be at least 0 and at most 1, got 1.5"),
        ({"form": "song"}, "planner.form: must be one of equation, listing; got 'song'"),
        ({"time_budget": "-1"}, "planner.time_budget: must be above 0, got -1"),
        ({"ants": None}, "planner.ants: must be a whole number, got None"),
    ],
)
def test_wrong_option_values_are_refused_by_name(options: dict[str, object], message: str) -> None:
    with pytest.raises(InputError) as refused:
        load_planner("aco-han", **options)
    assert str(refused.value) == message


def test_every_planner_says_what_it_does_in_one_line() -> None:
    for name, planner in PLANNERS.items():
        line = describe(planner)
        assert line.endswith("."), name
        assert "\n" not in line
    assert "elitism 100" in describe(PLANNERS["aco-han-elite"])
    assert describe(PLANNERS["aco-han"]) == describe(AcoHan())


def test_naming_planners_does_not_load_the_compiler() -> None:
    code = (
        "import sys; from antdrive.planners import list_planners, load_planner, describe; list_planners();"
        "load_planner('aco-han', ants=3); assert 'numba' not in sys.modules, 'numba was imported'"
    )
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)


# What else has to know a new planner


def kernel_modules(planner: object) -> set[str]:
    """The kernel modules of a planner: those that the modules of its class and its bases import."""
    sources = (inspect.getsource(sys.modules[kind.__module__]) for kind in type(planner).__mro__[:-1])
    return {name for source in sources for name in re.findall(r"^ +from [\w.]+ import (_kernels_\w+)", source, re.M)}


@pytest.mark.parametrize("name", PLANNERS)
def test_a_planner_s_kernels_are_compiled_by_a_warm_up_group(name: str) -> None:
    groups = [names for names in TOGETHER if name in names]
    # The drive in the warm-up plans with `astar` and `as`, whose kernels other planners use, too.
    known = {kernel for names in (*TOGETHER, ("astar", "as")) for n in names for kernel in kernel_modules(PLANNERS[n])}
    assert groups or kernel_modules(PLANNERS[name]) <= known, f"add {name} to TOGETHER in cli/warm.py"


@pytest.mark.parametrize("name", PLANNERS)
def test_a_planner_has_a_line_style_of_its_own(name: str) -> None:
    assert name in PLANNER_STYLES, f"add {name} to views/style.py"
    assert list(PLANNER_STYLES.values()).count(PLANNER_STYLES[name]) == 1


@pytest.mark.parametrize("name", PLANNERS)
def test_a_planner_s_class_is_offered_by_the_package(name: str) -> None:
    assert type(PLANNERS[name]).__name__ in antdrive.planners.__all__, "add it to planners/__init__.pyi"


@pytest.mark.parametrize("name", PLANNERS)
def test_a_planner_has_the_methods_that_it_declares(name: str) -> None:
    planner = PLANNERS[name]
    can = capabilities_of(planner)
    assert isinstance(can, Capabilities)
    assert can.iterative == hasattr(planner, "iterate")
    assert can.own_replanner == hasattr(planner, "replanner")
    assert can.cell_by_cell == hasattr(planner, "agent")


def test_an_unknown_planner_would_be_noticed() -> None:
    class Newcomer(GridPlanner):
        """As a planner whose module uses kernels that nothing warms up."""

        def _plan(self, query: Query, rng: np.random.Generator) -> PlanResult:
            raise NotImplementedError

    assert capabilities_of(Newcomer()) == Capabilities()
    assert "newcomer" not in PLANNER_STYLES
    assert kernel_modules(PLANNERS["sipp"]) >= {"_kernels_sipp"}
    assert kernel_modules(PLANNERS["ants"]) >= {"_kernels_colony", "_kernels_search"}
