"""The shape of the code: functions that fit on a screen, one meaning for each class name, names that reach `help()`."""

from __future__ import annotations

import ast
import collections
import dataclasses
import importlib
import inspect
import re
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parent.parent / "src" / "antdrive"
PACKAGES = ("base", "worlds", "planners", "robots", "sim", "runs", "views", "cli")
MODULES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
BRANCHES = (ast.If, ast.For, ast.While, ast.IfExp, ast.BoolOp, ast.ExceptHandler, ast.comprehension, ast.match_case)
LINES, MOST_BRANCHES = 60, 25
KERNEL_LINES = 100
#: Parameters that their name and type explain.
PLAIN = {
    "self", "cls", "args", "kwargs", "path", "seed", "rng", "name", "robot", "world", "task", "grid", "query", "plan", "planner",
    "rollout", "route", "pose", "log",
}  # fmt: skip


def functions(path: Path) -> Iterator[ast.FunctionDef]:
    return (node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.FunctionDef))


def too_large(node: ast.FunctionDef, kernel: bool) -> str:
    """What is too much in a function, if anything."""
    lines = (node.end_lineno or 0) - node.lineno + 1
    branches = sum(isinstance(inner, BRANCHES) for inner in ast.walk(node))
    if kernel:
        return f"{lines} lines" if lines > KERNEL_LINES else ""
    return f"{lines} lines" if lines > LINES else f"{branches} branches" if branches > MOST_BRANCHES else ""


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(ROOT)))
def test_functions_fit_on_a_screen(path: Path) -> None:
    found = {node.name: too_large(node, path.name.startswith("_kernels")) for node in functions(path)}
    assert {name: why for name, why in found.items() if why} == {}


def test_a_large_function_is_noticed() -> None:
    long = ast.parse("def f():\n" + "    x = 1\n" * 60).body[0]
    branchy = ast.parse("def f():\n" + "    x = 1 if y else 2\n" * 26).body[0]
    assert isinstance(long, ast.FunctionDef)
    assert isinstance(branchy, ast.FunctionDef)
    assert (too_large(long, False), too_large(long, True)) == ("61 lines", "")
    assert too_large(branchy, False) == "26 branches"


def test_files_of_the_command_line_are_short() -> None:
    lengths = {path.name: len(path.read_text().splitlines()) for path in (ROOT / "cli").rglob("*.py")}
    assert {name: length for name, length in lengths.items() if length > 250} == {}


def test_a_class_name_has_one_meaning() -> None:
    names = collections.Counter(
        node.name
        for path in MODULES
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ClassDef)
    )
    assert [name for name, count in names.items() if count > 1] == []


def public() -> list[tuple[str, Any]]:
    found = {}
    rooms = ("testing", "sim.campaigns", "sim.regression", "sim.sensing")
    for package in ("antdrive", *(f"antdrive.{name}" for name in (*PACKAGES, *rooms))):
        module = importlib.import_module(package)
        found |= {f"{package}.{name}": getattr(module, name) for name in module.__all__}
    return [(name, thing) for name, thing in found.items() if inspect.isclass(thing) or inspect.isfunction(thing)]


def undescribed_fields(thing: type) -> list[str]:
    """The public fields of a record that no docstring of its classes describes in a line of their own."""
    if dataclasses.is_dataclass(thing):
        fields = [field.name for field in dataclasses.fields(thing)]
    else:
        fields = list(getattr(thing, "_fields", getattr(thing, "model_fields", ())))
    described = "\n".join(inspect.cleandoc(base.__doc__ or "") for base in thing.__mro__)
    models = getattr(thing, "model_fields", {})
    return [
        field for field in fields
        if not field.startswith("_") and not re.search(rf"^\s*{field}\b[^:\n]*:", described, re.MULTILINE)
        and not (field in models and models[field].description)
    ]  # fmt: skip


def undescribed_parameters(function: Any) -> list[str]:
    doc = inspect.getdoc(function) or ""
    names = [name for name in inspect.signature(function).parameters if name not in PLAIN and not name.startswith("_")]
    return [name for name in names if not re.search(rf"\b{name}\b", doc)]


def untold_errors(function: Any, doc: str) -> set[str]:
    """The names of what a function's own lines raise, if its docstring has no part on errors."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    raised = {
        node.exc.func for node in ast.walk(tree) if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call)
    }
    names = {function.id for function in raised if isinstance(function, ast.Name)} - {"NotImplementedError"}
    return set() if "Raises:" in doc else names


def test_public_functions_and_records_tell_what_they_raise() -> None:
    untold = {}
    for name, thing in public():
        members = vars(thing).items() if inspect.isclass(thing) else [("", thing)]
        for key, member in members:
            function = member.__func__ if isinstance(member, classmethod | staticmethod) else member
            if inspect.isfunction(function) and "<string>" not in function.__code__.co_filename:
                of_class = key == "__post_init__"
                if key.startswith("_") and not of_class:
                    continue
                untold[f"{name}.{key}"] = untold_errors(function, inspect.getdoc(thing if of_class else function) or "")
    assert {name: errors for name, errors in untold.items() if errors} == {}


def test_an_error_that_is_not_told_is_noticed() -> None:
    def half(ants: int) -> None:
        if ants < 1:
            raise ValueError("ants")

    assert untold_errors(half, "Half of the ants.") == {"ValueError"}
    assert untold_errors(half, "Half of the ants.\n\nRaises:\n    ValueError: fewer than one.") == set()


@pytest.mark.parametrize(("name", "thing"), public(), ids=[name for name, _ in public()])
def test_public_names_document_their_fields_and_parameters(name: str, thing: Any) -> None:
    missing = undescribed_fields(thing) if inspect.isclass(thing) else undescribed_parameters(thing)
    if inspect.isclass(thing):
        for key, member in vars(thing).items():
            function = member.__func__ if isinstance(member, classmethod | staticmethod) else member
            if inspect.isfunction(function) and not key.startswith("_"):
                missing += [f"{key}({parameter})" for parameter in undescribed_parameters(function)]
    assert inspect.getdoc(thing), f"{name} has no docstring"
    assert missing == []


def test_a_field_without_a_description_is_noticed() -> None:
    @dataclasses.dataclass
    class Half:
        """A record.

        Attributes:
            told: described
        """

        told: int
        untold: int

    assert undescribed_fields(Half) == ["untold"]
