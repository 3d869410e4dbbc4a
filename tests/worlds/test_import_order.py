"""Within worlds, a module imports only modules that come before it, also inside functions and for types alone."""

import ast
from pathlib import Path

import pytest

WORLDS = Path(__file__).parents[2] / "worlds"
ORDER = [
    "errors", "types", "limits", "optional", "processes", "plane", "drawing", "kernel_cache", "_kernels_compiler", "_kernels",
    "movers", "motions", "world", "reuse", "geometry", "grid", "ends", "route", "trajectories",
    "files.atomic", "files.reading", "files.document", "files.checks", "files.world_file",
    "formats._kernels_cover", "formats.checks", "formats.cellmap", "formats.xml", "formats.sdf_models", "formats.sdf",
    "formats.barn", "formats.dynabarn", "formats.movingai", "formats.map_server", "formats.importing",
    "generators.automaton", "generators.generate",
]  # fmt: skip
MODULES = {
    ".".join(path.relative_to(WORLDS).with_suffix("").parts): path
    for path in WORLDS.rglob("*.py")
    if path.name != "__init__.py"
}


def imported(source: str) -> set[str]:
    """The modules of worlds that a module's text imports."""
    names = {
        name
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.ImportFrom)
        for name in (node.module, *(f"{node.module}.{alias.name}" for alias in node.names))
    }
    return {name.removeprefix("antdrive.worlds.") for name in names} & set(MODULES)


def test_the_order_lists_every_module():
    assert sorted(ORDER) == sorted(MODULES)


@pytest.mark.parametrize("module", ORDER)
def test_a_module_imports_only_modules_before_it(module):
    before = ORDER[: ORDER.index(module)]
    assert imported(MODULES[module].read_text()) <= set(before)


def test_imports_inside_functions_count():
    source = "def f():\n    from antdrive.worlds.grid import Grid\n    from antdrive.worlds import _kernels\n"
    assert imported(source) == {"grid", "_kernels"}
