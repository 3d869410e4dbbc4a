"""Leaf kernels count no references, so arrays must not be made in them nor returned to them."""

import ast
import gc
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import antdrive
from antdrive.worlds._kernels import Array, kernel, leaf

SOURCES = sorted(Path(antdrive.__file__).parent.rglob("_kernels*.py"))
ALLOCATES = {
    "empty", "zeros", "ones", "full", "array", "arange", "empty_like", "zeros_like", "copy", "stack", "concatenate",
}  # fmt: skip


def decorated(trees: list[ast.Module]) -> Iterator[tuple[str, ast.FunctionDef]]:
    """Yield all kernels with their decorators."""
    for tree in trees:
        for node in tree.body:
            if isinstance(node, ast.FunctionDef) and node.decorator_list:
                yield ast.unparse(node.decorator_list[0]), node


def words(node: ast.AST | None) -> set[str]:
    """Return the words of a piece of code."""
    return set(re.findall(r"\w+", ast.unparse(node))) if node else set()


def holders(trees: list[ast.Module]) -> set[str]:
    """Return the names of the types that are or hold arrays."""
    classes = [node for tree in trees for node in tree.body if isinstance(node, ast.ClassDef)]
    found, before = {"Array"}, set[str]()
    while found != before:
        before = set(found)
        for one in classes:
            if any(isinstance(part, ast.AnnAssign) and words(part.annotation) & found for part in one.body):
                found.add(one.name)
    return found


def faults(sources: list[str]) -> list[str]:
    """Return the leaf kernels that make, return or receive arrays."""
    trees = [ast.parse(source) for source in sources]
    kernels, arrays = list(decorated(trees)), holders(trees)
    returning = {node.name for kind, node in kernels if kind == "kernel" and words(node.returns) & arrays}
    found = []
    for kind, node in kernels:
        if kind != "leaf":
            continue
        called = {ast.unparse(call.func).removeprefix("np.") for call in ast.walk(node) if isinstance(call, ast.Call)}
        if words(node.returns) & arrays or called & (ALLOCATES | returning):
            found.append(node.name)
    return found


def test_leaf_kernels_make_return_and_receive_no_arrays() -> None:
    sources = [path.read_text() for path in SOURCES]
    assert any("@leaf" in source for source in sources)
    assert not faults(sources)


@pytest.mark.parametrize(
    "body",
    [
        "def f(a: Array) -> float:\n    return np.zeros(3)[0]",
        "def f(a: Array) -> Array:\n    return a",
        "def f(a: Array) -> float:\n    return made(a)[0]",
        "class Held(NamedTuple):\n    a: Array\n\ndef f(a: Array) -> Held:\n    return Held(a)",
    ],
)
def test_the_search_finds_faults(body: str) -> None:
    assert faults(
        ["@kernel\ndef made(a: Array) -> Array:\n    return a\n\n" + body.replace("def f", "@leaf\ndef f")]
    ) == ["f"]


@leaf
def total(table: Array) -> float:
    found = 0.0
    for row in range(table.shape[0]):
        found += first(table[row])
    return found


@kernel
def first(row: Array) -> float:
    return float(np.array([row[0]])[0])


def test_a_leaf_keeps_the_counts_of_its_arrays() -> None:
    table = np.arange(6.0).reshape(3, 2)
    assert total(table) == 6.0
    before = sys.getrefcount(table)
    for _ in range(10):
        assert total(table) == 6.0
    gc.collect()
    assert sys.getrefcount(table) == before
