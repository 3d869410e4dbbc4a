"""One meaning for each class name, and docstrings that tell users of a public name what they need."""

import ast
import collections
import dataclasses
import importlib
import inspect
import re
import textwrap
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent / "src" / "antdrive"
PACKAGES = ("base", "worlds", "planners", "robots", "proof", "sim", "foreign", "runs", "views", "testing", "gym", "cli")
MODULES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
#: Parameters that their name and type explain.
PLAIN = {
    "self", "cls", "args", "kwargs", "path", "seed", "rng", "name", "robot", "spec", "world", "task", "grid", "query", "plan",
    "planner", "rollout", "route", "pose", "log",
}  # fmt: skip


def test_a_class_name_has_one_meaning():
    names = collections.Counter(
        name for path in MODULES for name in re.findall(r"^ *class (\w+)[(:]", path.read_text(), re.MULTILINE)
    )
    assert [name for name, count in names.items() if count > 1] == []


def public():
    found = {}
    rooms = ("runs.campaigns", "runs.suites", "sim.sensing")
    for package in ("antdrive", *(f"antdrive.{name}" for name in (*PACKAGES[:-1], *rooms))):
        module = importlib.import_module(package)
        found |= {f"{package}.{name}": getattr(module, name) for name in module.__all__}
    return [(name, thing) for name, thing in found.items() if inspect.isclass(thing) or inspect.isfunction(thing)]


def undescribed_fields(thing):
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


def undescribed_parameters(function):
    doc = inspect.getdoc(function) or ""
    names = [name for name in inspect.signature(function).parameters if name not in PLAIN and not name.startswith("_")]
    return [name for name in names if not re.search(rf"\b{name}\b", doc)]


def untold_errors(function, doc):
    """The names of what a function's own lines raise, if its docstring has no part on errors."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    raised = {
        node.exc.func for node in ast.walk(tree) if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call)
    }
    names = {function.id for function in raised if isinstance(function, ast.Name)} - {"NotImplementedError"}
    return set() if "Raises:" in doc else names


def test_public_functions_and_records_tell_what_they_raise():
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


@pytest.mark.parametrize(("name", "thing"), public(), ids=[name for name, _ in public()])
def test_public_names_document_their_fields_and_parameters(name, thing):
    missing = undescribed_fields(thing) if inspect.isclass(thing) else undescribed_parameters(thing)
    if inspect.isclass(thing):
        for key, member in vars(thing).items():
            function = member.__func__ if isinstance(member, classmethod | staticmethod) else member
            if inspect.isfunction(function) and not key.startswith("_"):
                missing += [f"{key}({parameter})" for parameter in undescribed_parameters(function)]
    assert inspect.getdoc(thing), f"{name} has no docstring"
    assert missing == []
