"""Kernels without machine code run in Python, with the results of machine code, until that takes long."""

import math
import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.base._kernels_compiler import kernel
from antdrive.base._kernels_interpreter import interpret
from antdrive.base.kernel_cache import compiled, text_of
from antdrive.worlds import _kernels

pytestmark = pytest.mark.skipif(bool(os.environ.get("NUMBA_DISABLE_JIT")), reason="needs compiled kernels")
finite = st.floats(-1e6, 1e6)


class Pair(NamedTuple):
    values: np.ndarray
    factor: float


def add_up(values, start):
    for i in range(len(values)):
        values[i] += start
        start += values[i]
    return start


def divided(values, by):
    values[0] = 7.0
    return 2.0 / by


def measured(pair, x):
    return math.hypot(pair.values[0] * pair.factor, x), len(pair.values) > 2, np.int64(3), abs(x) ** 0.3


def sorted_by(values):
    return np.argsort(values)


def squared(x):
    return x**2


def interrupted(values):
    values[0] = 7.0
    interrupt()
    return values[0]


def interrupt():
    raise KeyboardInterrupt


def counted(count):
    total = 0
    for i in range(count):
        total += add_one(i)
    return total


@kernel
def add_one(i):
    return i + 1


def overflowing(small):
    return small[0] + small[1]


@pytest.fixture
def fresh():
    """Return a function that makes a kernel without machine code."""

    def made(function):
        dispatcher = kernel(function)
        dispatcher._cache.__dict__["holds_any"] = False
        return dispatcher

    return made


def test_a_kernel_is_compiled_when_its_calls_have_taken_long(fresh, monkeypatch):
    total = fresh(add_up)
    monkeypatch.setattr(type(total), "left", 100)
    ours, theirs = np.arange(30.0), np.arange(30.0)
    for call in range(5):
        assert total(ours, 0.5) == add_up(theirs, 0.5)
        assert ours.tobytes() == theirs.tobytes()
        assert bool(total.overloads) is (call > 2)  # 31 passes each: the fourth is undone


@pytest.mark.parametrize("allowance", [30, 31, 32, 33])
def test_a_call_is_made_once_where_the_allowance_ends(fresh, monkeypatch, allowance):
    total = fresh(add_up)
    monkeypatch.setattr(type(total), "left", allowance)
    ours, theirs = np.arange(30.0), np.arange(30.0)
    assert total(ours, 0.5) == add_up(theirs, 0.5)
    assert ours.tobytes() == theirs.tobytes()


def test_a_call_that_python_refuses_begins_again_in_machine_code(fresh):
    divide = fresh(divided)
    values = np.arange(3.0) + 1
    assert divide(values, 4.0) == 0.5
    assert not divide.overloads
    assert math.isinf(divide(values, 0.0))
    assert divide.overloads
    assert values.tolist() == [7.0, 2.0, 3.0]


def test_an_integer_that_overflows_is_computed_in_machine_code(fresh):
    assert fresh(overflowing)(np.array([200, 100], dtype=np.uint8)) == 300


def test_float32_is_computed_in_machine_code(fresh):
    total = fresh(add_up)
    total(np.zeros(3, dtype=np.float32), 0.1)
    assert total.overloads


def test_an_interrupted_call_changes_nothing():
    values = np.zeros(3)
    with pytest.raises(KeyboardInterrupt):
        interpret(interrupted, (values,), {}, 100)
    assert values.tolist() == [0.0, 0.0, 0.0]
    assert interpret(add_up, (values, 1.0), {}, 100)[0] == 100 - 4


def test_arrays_without_room_for_a_copy_change_in_machine_code():
    class Huge(np.ndarray):
        def copy(self, order="C"):
            raise MemoryError

    assert interpret(add_up, (np.zeros(3).view(Huge), 1.0), {}, 100) == (0, None)


def test_sorting_counts():
    assert interpret(sorted_by, (np.zeros(40),), {}, 1000)[0] == 1000 - 20 * 40 - 2
    assert interpret(sorted_by, (np.zeros(60),), {}, 1000) == (0, None)


def test_a_square_is_computed_in_machine_code():
    """Python's `x ** 2` differs from numba's product in one of a thousand cases."""
    assert interpret(squared, (1.5,), {}, 100) == (0, None)


def test_python_runs_the_text_that_was_imported(monkeypatch):
    file = Path(_kernels.__file__)
    monkeypatch.setattr(Path, "read_bytes", lambda _: b"edited since")
    assert b"def doubled" in text_of(file)


def test_a_block_compiles_at_the_first_call(fresh):
    total = fresh(add_up)
    with compiled():
        total(np.zeros(3), 1.0)
    assert total.overloads


def test_kernels_that_a_kernel_calls_count(fresh, monkeypatch):
    count = fresh(counted)
    monkeypatch.setattr(type(count), "left", 20)
    assert count(4) == 10  # a call, four passes and four calls
    assert not count.overloads
    assert count(6) == 21
    assert count.overloads


@given(st.lists(finite, min_size=1, max_size=5), finite, finite)
def test_results_have_the_bits_and_types_of_machine_code(values, factor, x):
    pair = Pair(np.array(values), factor)
    left, found = interpret(measured, (pair, x), {}, 10)
    expected = MEASURED(pair, x)
    assert left == 9
    assert found == expected
    assert [type(one) for one in found] == [type(one) for one in expected]


@given(st.lists(st.sampled_from([0.0, 1.0, 2.0, math.nan]), max_size=60))
def test_equal_values_have_the_order_of_machine_code(values):
    _, found = interpret(sorted_by, (np.array(values, dtype=float),), {}, 10_000)
    assert found.tolist() == SORTED(np.array(values, dtype=float)).tolist()


with compiled():
    MEASURED, SORTED = kernel(measured), kernel(sorted_by)
    MEASURED(Pair(np.zeros(1), 1.0), 1.0), SORTED(np.zeros(2))

# Every call of a kernel from Python is made twice: in Python with copies of its arguments, and in machine code.
BOTH = """
import sys
import numpy as np
from numba.core.registry import CPUDispatcher
from antdrive.base import _kernels_dispatcher, kernel_cache
from antdrive.base._kernels_interpreter import interpret
from antdrive.planners import PLANNERS
from antdrive.sim import Scenario, run
from antdrive.cli import warming

calls, kinds = {}, set()

def copied(value):
    if isinstance(value, np.ndarray):
        made = value.copy()
        made.flags.writeable = value.flags.writeable
        return made
    if isinstance(value, tuple):
        return type(value)(*map(copied, value)) if hasattr(value, "_fields") else tuple(map(copied, value))
    return value

def bits(value):
    if isinstance(value, np.ndarray):
        return value.dtype, value.shape, value.tobytes()
    return (type(value), *map(bits, value)) if isinstance(value, tuple) else (type(value), repr(value))

def twice(self, *args):
    name = self.py_func.__name__
    calls[name] = calls.get(name, 0) + 1
    left = 0
    if calls[name] <= 25:
        blocks, kernel_cache.blocks = kernel_cache.blocks, 0
        copies = copied(args)
        left, found = interpret(self.py_func, copies, {}, 50_000)
        kernel_cache.blocks = blocks
    result = CPUDispatcher.__call__(self, *args)
    if left:
        kinds.add(name)
        parts = [bits(pair) for pair in ((found, copies), (result, args))]
        if name == "legs_within":  # its arrays have places for more legs
            parts = [bits((*(one[: out[2]] for one in out[:2]), out[2])) for out in (found, result)]
        assert parts[0] == parts[1], (name, found, result)
    return result

_kernels_dispatcher._Uncompiled.__call__ = twice
for name in PLANNERS:
    warming.plan_with(name)
warming.drive()
run(Scenario.of("forest", "astar"))
run(Scenario.of("forest", "dstar-lite", map="none", time_limit=6.0))
run(Scenario.of("plaza-moving", "dstar-lite", time_limit=6.0))
print(len(kinds), *sorted(kinds))
"""


@pytest.mark.slow
def test_every_kernel_gives_in_python_what_it_gives_in_machine_code():
    done = subprocess.run([sys.executable, "-c", BOTH], capture_output=True, text=True, timeout=1800, check=False)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout.split()[0]) > 60
