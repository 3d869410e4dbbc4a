"""The shape of the code: who imports whom, and what the packages offer."""

import ast
import importlib
import pkgutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent / "src" / "antdrive"
#: A room imports itself and the rooms of lower ranks.
RANKS = {"base": 0, "worlds": 1, "planners": 2, "robots": 2, "sim": 3, "runs": 4, "views": 5, "cli": 6}
MODULES = sorted(path for room in RANKS for path in (ROOT / room).rglob("*.py"))
#: Imports that still climb.
CLIMBING = {
    ("runs.papers.reproduce", "views.papers"),
    ("worlds.reuse", ""),
}

#: Inside sim: a part may import its own modules and those of the parts in lower ranks.
SIM_RANKS = {
    "physics": 0,
    "log": 0,
    "sensing": 0.5,
    "driving": 1,
    "policy": -2,
    "settings": -1,
    "forms": 2,
    "resolving": 1,
    "scenario": 2,
    "reasons": 2,
    "unknown": 2.5,
    "pipeline": 3,
}


def imported(path: Path, *, types: bool = True) -> set[str]:
    """All that a module imports, inside functions too; `types`: also what it imports for type checking alone."""
    names = set()
    nodes = [ast.parse(path.read_text())]
    while nodes:
        node = nodes.pop()
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are written in full"
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
        elif types or not (isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"):
            nodes += ast.iter_child_nodes(node)
    return names


def module_name(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def module_imports() -> dict[str, set[str]]:
    """The modules of the four packages that each of them imports when it runs."""
    known = {module_name(path) for path in MODULES}
    return {
        module_name(path): {name.removeprefix("antdrive.") for name in imported(path, types=False)}
        & known - {module_name(path)}
        for path in MODULES
    }


def circles(graph: dict[str, set[str]]) -> list[set[str]]:
    """The groups of nodes that reach each other."""
    reached = {}
    for start in graph:
        found, todo = set(), [start]
        while todo:
            fresh = graph.get(todo.pop(), set()) - found
            found |= fresh
            todo += fresh
        reached[start] = found
    groups = {frozenset(b for b in graph if b in reached[a] and a in reached[b]) for a in graph}
    return [set(group) for group in groups if group]


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_go_one_way(path: Path) -> None:
    room, module = path.relative_to(ROOT).parts[0], module_name(path)
    for name in imported(path):
        if name.startswith("antdrive."):
            top = name.split(".")[1]
            known = any(module == a and name.startswith(f"antdrive.{b}") for a, b in CLIMBING)
            assert top == room or RANKS[top] < RANKS[room] or known, f"{path.name} imports {name}"
        assert name.split(".")[0] not in ("tests", "benchmarks", "examples", *RANKS)


def test_a_climbing_import_would_be_seen(tmp_path: Path) -> None:
    module = tmp_path / "m.py"
    module.write_text("def f():\n    from antdrive.sim.physics.engine import Engine\n")
    assert "antdrive.sim.physics.engine" in imported(module)


def test_pybullet_is_imported_by_one_module_and_numba_by_kernels() -> None:
    assert [p.name for p in MODULES if "pybullet" in imported(p)] == ["bullet.py"]
    assert all(p.name.startswith("_kernels") for p in MODULES if "numba" in imported(p))


@pytest.mark.parametrize("path", [p for p in MODULES if p.is_relative_to(ROOT / "sim")], ids=module_name)
def test_the_parts_of_sim_have_an_order(path: Path) -> None:
    part = path.relative_to(ROOT / "sim").with_suffix("").parts[0]
    if part == "__init__":
        return
    for name in imported(path, types=False):
        if name.startswith("antdrive.sim."):
            other = name.split(".")[2]
            assert other == part or SIM_RANKS[other] < SIM_RANKS[part], f"{module_name(path)} imports {name}"


def test_modules_have_no_circles() -> None:
    assert circles(module_imports()) == []


def test_subpackages_have_no_circles() -> None:
    graph: dict[str, set[str]] = {}
    folders = {module_name(path): module_name(path.parent) for path in MODULES if path.name != "__init__.py"}
    for module, others in module_imports().items():
        for other in others & folders.keys():
            a, b = folders.get(module, module), folders[other]
            if not f"{a}.".startswith(f"{b}.") and not f"{b}.".startswith(f"{a}."):
                graph.setdefault(a, set()).add(b)
    assert circles(graph) == []


def test_a_circle_would_be_seen() -> None:
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}) == [{"a", "b", "c"}]


@pytest.mark.parametrize("package", [room for room in RANKS if (ROOT / room / "__init__.pyi").exists()])
def test_every_exported_name_exists_and_hides_no_module(package: str) -> None:
    module = importlib.import_module(f"antdrive.{package}")
    submodules = {info.name for info in pkgutil.iter_modules(module.__path__)}
    assert module.__all__
    for name in module.__all__:
        assert getattr(module, name) is not None
        # `from sim import run` must mean the same whether or not a module sim.run was imported before.
        assert name not in submodules


@pytest.mark.parametrize(
    "words", [["--help"], ["--version"], ["run", "--help"], ["planners", "--help"], ["robts"]], ids=" ".join
)
def test_light_commands_import_nothing_heavy(words: list[str]) -> None:
    code = (
        "import sys; from antdrive.cli.app import main\n"
        f"sys.argv = ['antdrive', *{words!r}]\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "print([m for m in ('numpy', 'numba', 'pybullet', 'matplotlib', 'PIL') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
