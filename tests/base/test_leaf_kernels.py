"""Leaf kernels count no references, so arrays must not be made in them nor returned to them."""

import ast
import gc
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import antdrive
from antdrive.worlds._kernels import Array, kernel, leaf

SOURCES = sorted(Path(antdrive.__file__).parent.rglob("_kernels*.py"))
ALLOCATES = {
    "empty",
    "zeros",
    "ones",
    "full",
    "array",
    "arange",
    "empty_like",
    "zeros_like",
    "copy",
    "stack",
    "concatenate",
}


def decorated(trees: list[ast.Module]) -> Iterator[tuple[str, ast.FunctionDef]]:
    """Yield all kernels with their decorators."""
    for tree in trees:
        for node in tree.body:
            if isinstance(node, ast.FunctionDef) and node.decorator_list:
                yield ast.unparse(node.decorator_list[0]), node


def faults(sources: list[str]) -> list[str]:
    """Return the leaf kernels that make, return or receive arrays."""
    kernels = list(decorated([ast.parse(source) for source in sources]))
    returning = {
        node.name for kind, node in kernels if kind == "kernel" and "Array" in ast.unparse(node.returns or node)
    }
    found = []
    for kind, node in kernels:
        if kind != "leaf":
            continue
        called = {ast.unparse(call.func).removeprefix("np.") for call in ast.walk(node) if isinstance(call, ast.Call)}
        if "Array" in ast.unparse(node.returns or node) or called & (ALLOCATES | returning):
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
    ],
)
def test_the_search_finds_faults(body: str) -> None:
    assert faults(["@kernel\ndef made(a: Array) -> Array:\n    return a\n\n@leaf\n" + body]) == ["f"]


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
