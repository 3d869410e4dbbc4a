"""The shape of the code: who imports whom, and what the packages offer."""

import ast
import importlib
import pkgutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = ("worlds", "planners", "robots", "sim")
BELOW = {
    "worlds": set(),
    "planners": {"worlds"},
    "robots": {"worlds"},
    "sim": {"worlds", "planners", "robots"},
}
MODULES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))


def imported(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are written in full"
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return names


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_go_one_way(path: Path) -> None:
    package = path.relative_to(ROOT).parts[0]
    for name in imported(path):
        if name.startswith("antdrive."):
            top = name.split(".")[1]
            assert top == package or top in BELOW[package], f"{path.name} imports {name}"
        assert name.split(".")[0] not in ("tests", "benchmarks", "examples", *PACKAGES)


def test_a_climbing_import_would_be_seen(tmp_path: Path) -> None:
    module = tmp_path / "m.py"
    module.write_text("def f():\n    from antdrive.sim.physics.engine import Engine\n")
    assert "antdrive.sim.physics.engine" in imported(module)


def test_pybullet_is_imported_by_one_module_and_numba_by_kernels() -> None:
    assert [p.name for p in MODULES if "pybullet" in imported(p)] == ["engine.py"]
    assert all(p.name.startswith("_kernels") for p in MODULES if "numba" in imported(p))


@pytest.mark.parametrize("package", PACKAGES)
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
        "import sys; from antdrive.sim.cli import main\n"
        f"sys.argv = ['antdrive', *{words!r}]\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "print([m for m in ('numpy', 'numba', 'pybullet', 'matplotlib', 'PIL') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
