"""Who imports whom, and what the rooms offer."""

import ast
import functools
import importlib
import pkgutil
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from antdrive.cli.listings import LISTS

ROOT = Path(__file__).parent.parent / "src" / "antdrive"
#: A room imports itself and the rooms of lower ranks.
RANKS = {
    "base": 0,
    "worlds": 1,
    "planners": 2,
    "robots": 2,
    "proof": 3,
    "foreign": 5,
    "sim": 4,
    "runs": 6,
    "views": 7,
    "testing": 8,
    "gym": 8,
    "cli": 9,
}
MODULES = sorted(path for room in RANKS for path in (ROOT / room).rglob("*.py"))
#: Functions that hide a package of their name; its kernels keep this one where it is.
HIDING = {"views.film"}


def name_of(path):
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def statements(tree):
    """All statements, inside functions too, each with whether it is for type checking alone."""
    found = [(tree, False)]
    for node, types in found:
        types = types or (isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING")
        blocks = (ast.stmt, ast.excepthandler, ast.match_case)
        found += [(child, types) for child in ast.iter_child_nodes(node) if isinstance(child, blocks)]
    return found


@functools.cache
def imports(path):
    """The modules and names that a module imports, by whether for type checking alone."""
    names = {True: set(), False: set()}
    for node, types in statements(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names[types] |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are written in full"
            names[types] |= {str(node.module)} | {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def imported(path):
    return set().union(*imports(path).values())


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_imports_go_one_way(path):
    module = name_of(path)
    room = module.split(".")[0]
    for name in imported(path):
        top, _, rest = name.partition(".")
        assert top not in ("tests", "benchmarks", "examples", *RANKS), f"{module} imports {name}"
        if top == "antdrive" and rest:
            other = rest.split(".")[0]
            assert other == room or RANKS[other] < RANKS[room], f"{module} imports {name}"


def test_imports_have_no_circles():
    """Neither modules, with their imports for types, nor folders; `graphlib` raises an error that names a circle."""
    known = {f"antdrive.{name_of(path)}": path for path in MODULES}
    modules = {}
    folders = {}
    for module, path in known.items():
        there = set(known) - {module}
        modules[module] = imported(path) & there
        for other in (known[one] for one in imports(path)[False] & there):
            a, b = path.parent, other.parent
            if other.name != "__init__.py" and not (a.is_relative_to(b) or b.is_relative_to(a)):
                folders.setdefault(a, set()).add(b)
    TopologicalSorter(modules).prepare()
    TopologicalSorter(folders).prepare()


#: What knows the truth: the body of a robot, and what drives one.
BODY = {
    "body",
    "drive",
    "leaving",
    "odometry",
    "plants",
    "routes",
    "senses",
}


def test_a_mind_imports_neither_physics_nor_what_is_true():
    """`routes` rehearses a narrow start in the robot's map."""
    for path in (ROOT / "sim" / "driving").glob("*.py"):
        names = imported(path) if path.stem not in BODY else set()
        assert not {name for name in names if "physics" in name or name.endswith("Trajectories")}, path
        assert not {f"antdrive.sim.driving.{body}" for body in BODY - {"routes"}} & names, path


def test_pybullet_is_imported_by_one_module_and_numba_by_kernels():
    assert [path.name for path in MODULES if "pybullet" in imported(path)] == ["bullet.py"]
    assert all(path.name.startswith("_kernels") for path in MODULES if "numba" in imported(path))


@pytest.mark.parametrize("room", [room for room in RANKS if (ROOT / room / "__init__.pyi").exists()])
def test_every_offered_name_exists_and_hides_no_module(room):
    """`from antdrive.sim import run` means the same whether or not a module sim.run was imported before."""
    module = importlib.import_module(f"antdrive.{room}")
    submodules = {info.name for info in pkgutil.iter_modules(module.__path__)}
    assert module.__all__
    for name in module.__all__:
        assert getattr(module, name) is not None
        assert name not in submodules or f"{room}.{name}" in HIDING


@pytest.mark.parametrize(
    "words", [["--help"], ["--version"], ["run", "--help"], ["planners", "--help"], ["robts"], *LISTS], ids=" ".join
)
def test_light_commands_import_nothing_heavy(words):
    code = (
        "import sys; from antdrive.cli.app import main\n"
        f"sys.argv = ['antdrive', *{words!r}]\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "print([m for m in ('numpy', 'numba', 'pybullet', 'matplotlib', 'PIL') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
