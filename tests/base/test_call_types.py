"""Types of calls within kernels, resolved once for each combination of argument types."""

import math
import operator

import numba
import numpy as np
import pytest
from numba.core import compiler, types
from numba.core.registry import cpu_target
from numba.core.targetconfig import ConfigStack

from antdrive.base import _kernels_dispatcher as compiling
from antdrive.base._kernels_compiler import kernel
from antdrive.base.kernel_cache import compiled

CONTEXT = cpu_target.typing_context
ROW = types.Array(types.float64, 1, "C")
CALLS = [
    (operator.add, (types.float64, types.int64)),
    (operator.lt, (types.int64, types.literal(3))),
    (operator.mod, (types.float64, types.float64)),
    (operator.getitem, (ROW, types.int64)),
    (operator.getitem, (types.Array(types.int64, 2, "C"), types.UniTuple(types.int64, 2))),
    (operator.mul, (ROW, types.float64)),
    (math.hypot, (types.float64, types.float64)),
    (len, (ROW,)),
    (max, (types.int64, types.float64)),
]


def flags(counting):
    found = compiler.Flags()
    cpu_target.options.parse_as_flags(found, {"error_model": "numpy", "nopython": True, "_nrt": counting})
    return found


@pytest.fixture
def asked(monkeypatch):
    """The calls that numba resolves itself."""
    calls = []
    own = compiling._resolve
    monkeypatch.setattr(compiling, "_resolved", {})
    monkeypatch.setattr(compiling, "_resolve", lambda *call: calls.append(call) or own(*call))
    CONTEXT.refresh()
    with compiling._resolving_once():
        yield calls


@pytest.mark.parametrize(("function", "args"), CALLS)
def test_a_call_is_resolved_once_as_numba_does(function, args, asked):
    kind = CONTEXT.resolve_value_type(function)
    with ConfigStack().enter(flags(True)):
        first, again = (kind.get_call_type(CONTEXT, args, {}) for _ in range(2))
        mine = [call for call in asked if call[0] is kind and call[2] == args]
        own = compiling._resolve(kind, CONTEXT, args, {})
    assert len(mine) == 1
    assert first == again == own


def test_code_with_and_without_counted_references_is_kept_apart(asked):
    kind, args = CONTEXT.resolve_value_type(operator.mul), (ROW, types.float64)
    found = []
    for counting in (True, False, True):
        with ConfigStack().enter(flags(counting)):
            signature = kind.get_call_type(CONTEXT, args, {})
            found.append(kind.get_impl_key(signature))
    assert len([call for call in asked if call[0] is kind and call[2] == args]) == 2
    assert found[0] is found[2]


def test_types_that_may_still_change_are_resolved_each_time(asked):
    kind, args = CONTEXT.resolve_value_type(len), (types.List(types.undefined),)
    for _ in range(2):
        kind.get_call_type(CONTEXT, args, {})
    assert len([call for call in asked if call[0] is kind]) == 2


def test_kernels_compute_what_python_does(asked):
    def mixed(row, factor, at):
        total = 0.0
        for k in range(len(row)):
            total += max(math.hypot(row[k], factor), row[at] % 0.7) * (k + 1) - (k > at)
        return total

    row = np.array([0.3, -1.2, 2.5])
    fast, plain = numba.njit(error_model="numpy")(mixed), mixed
    assert math.isclose(fast(row, 0.5, 1), plain(row, 0.5, 1), rel_tol=1e-15)
    count = len(asked)
    assert math.isclose(numba.njit(error_model="numpy")(mixed)(row, 0.5, 1), plain(row, 0.5, 1), rel_tol=1e-15)
    assert len(asked) - count < count / 4


def test_only_kernels_of_the_project_are_resolved_so(monkeypatch):
    seen = []
    resolved = compiling._call_type
    monkeypatch.setattr(compiling, "_call_type", lambda *call: seen.append(call) or resolved(*call))
    monkeypatch.setattr(compiling._Entries, "load", lambda *_: None)  # of an earlier run of this test
    assert numba.njit(lambda x: x + 1.5)(2.0) == 3.5
    assert seen == []
    with compiled():
        assert kernel(lambda x: x + 2.5)(2.0) == 4.5
    assert seen
    seen.clear()
    assert numba.njit(lambda x: x + 3.5)(2.0) == 5.5
    assert seen == []
