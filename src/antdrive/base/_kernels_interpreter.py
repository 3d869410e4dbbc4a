"""Interpretation of kernels that have no machine code yet.

To compile a kernel takes seconds, and Python often does its work in milliseconds. Python therefore runs it until its calls
have passed `ALLOWANCE` loops and functions. Then it is compiled: a call that passes more or fails is undone and begins again.
An interrupted call is undone.

Results have the bits of the compiled kernel: `math.hypot` is C's, `np.argsort` is numba's, and numbers leave as Python's.
Kernels of float32 are always compiled, as numba computes with 64 bits where NumPy keeps 32, and those with powers like `x**2`,
which numba multiplies; an integer that overflows is a failure.
"""

from __future__ import annotations

import ast
import functools
import inspect
import math
import threading
import types
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numba.misc.quicksort import make_py_quicksort

from antdrive.base import kernel_cache

ALLOWANCE = 250_000  # loop passes and function calls of one kernel in one process before it is compiled
COPIED = 1000  # elements of its arrays whose copy costs as much as one of them
SORTED = 20  # of them that sorting one element costs

_fuel = bytearray()  # its length is what is left of the allowance: the fastest count that raises at its end
_turn = threading.Lock()  # of the one thread that interprets
_TICK = ast.parse("_fuel.pop()").body[0]
_COUNTED = ast.FunctionDef | ast.For | ast.While
_quicksort = make_py_quicksort(lt=lambda a, b: a < b or (b != b and a == a), is_argsort=True).run_quicksort


def _argsort(values: np.ndarray, kind: str = "quicksort") -> np.ndarray:
    del _fuel[max(len(_fuel) - SORTED * len(values), 0) :]
    _fuel.pop()
    return np.argsort(values, kind="stable") if kind == "mergesort" else np.array(_quicksort(values))


_REPLACED = {
    math: types.SimpleNamespace(**{**vars(math), "hypot": np.hypot}),  # Python's is nearer the true length than C's
    np: types.SimpleNamespace(**{**vars(np), "argsort": _argsort}),  # another order of equal values
}


def interpret(
    function: Callable[..., Any], args: tuple[Any, ...], named: dict[str, Any], allowance: int
) -> tuple[int, Any]:
    """Run a kernel's function in Python.

    Returns what is left of the allowance, and the result. With nothing left there is none, and the arguments are as before.
    """
    arrays = list(_arrays((*args, *named.values())))
    changeable = [array for array in arrays if array.flags.writeable]
    allowance -= sum(array.size for array in changeable) // COPIED
    if allowance <= 0 or kernel_cache.blocks or any(array.dtype.char == "f" for array in arrays):
        return 0, None
    if not _turn.acquire(blocking=False):
        return 0, None
    before: list[np.ndarray] = []
    try:
        before += [array.copy() for array in changeable]
        twin = _twin(function)
        del _fuel[allowance - 1 :]  # so that a call that ends has something left
        _fuel.extend(bytes(allowance - 1 - len(_fuel)))
        with np.errstate(all="ignore", over="raise"):
            result = twin(*args, **named)
        return len(_fuel) + 1, _plain(result)
    except BaseException as error:  # such as a division by zero, which has a result in machine code; or an interrupt
        for array, values in zip(changeable, before, strict=False):
            array[...] = values
        if not isinstance(error, Exception):
            raise
        return 0, None
    finally:
        _turn.release()


def _arrays(value: Any) -> Iterator[np.ndarray]:
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, tuple):
        for part in value:
            yield from _arrays(part)


def _plain(value: Any) -> Any:
    """Return a result with the types that compiled kernels return."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, tuple):
        parts = map(_plain, value)
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    return value


@functools.cache
def _twin(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function for Python that counts its loops and calls no machine code."""
    file = inspect.getfile(function)
    code = _codes(file)[function.__name__]
    scope = _scope(function.__module__)
    if "float32" in code.co_names:
        raise TypeError(f"{function.__name__} computes with float32")
    made = scope[function.__name__] = types.FunctionType(code, scope, function.__name__, function.__defaults__)
    for name in _names(code):
        value = function.__globals__.get(name)
        if name not in scope and value is not None:
            replaced = _REPLACED.get(value) if isinstance(value, types.ModuleType) else None
            scope[name] = replaced or (_twin(value.py_func) if hasattr(value, "py_func") else value)
    return made


@functools.cache
def _scope(module: str) -> dict[str, Any]:
    """Return the globals of a module's twins."""
    return {"_fuel": _fuel, "__builtins__": __builtins__, "__name__": module}


def _names(code: types.CodeType) -> Iterator[str]:
    yield from code.co_names
    for const in code.co_consts:
        if isinstance(const, types.CodeType):
            yield from _names(const)


def _is_product(node: ast.AST) -> bool:
    """Return whether numba multiplies where Python calls `pow`, which rounds differently."""
    if not (isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow)):
        return False
    return isinstance(node.right, ast.Constant) and isinstance(node.right.value, int)


@functools.cache
def _codes(file: str) -> dict[str, types.CodeType]:
    """Return the code of a file's functions, each of which counts its calls and the passes of its loops."""
    with kernel_cache.uncollected():
        tree, functions = ast.parse(kernel_cache.text_of(Path(file)), file), list[ast.stmt]()
        for function in tree.body:
            nodes = list(ast.walk(function))
            if isinstance(function, ast.FunctionDef) and not any(map(_is_product, nodes)):
                function.decorator_list = []
                functions.append(function)
                for node in nodes:
                    if isinstance(node, _COUNTED):
                        node.body.insert(0, _TICK)
        whole = compile(ast.Module(functions, []), file, "exec")
        return {code.co_name: code for code in whole.co_consts if isinstance(code, types.CodeType)}
