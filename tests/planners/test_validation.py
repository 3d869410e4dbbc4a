"""Plan validation: a valid plan passes; an invalid one is rejected with the place of its error."""

import dataclasses
import math
import pickle
import re
import signal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.base import InputError
from antdrive.base.errors import Terminated
from antdrive.planners import (
    AStar,
    Capabilities,
    GridPlanner,
    History,
    PlannerError,
    PlanResult,
    PlanStatus,
    Query,
    SafeIntervals,
    TimedPlan,
    agent_for,
    as_iterative,
    capabilities_of,
    load_planner,
    path_cost,
    replanner_for,
    request_plan,
    validate_plan,
    validated,
)
from antdrive.worlds import Cruising, Disc, Grid, Task, Trajectories, World, rasterise
from tests.planners.worlds_to_solve import catalogue

QUERY = catalogue()["trap"]
RNG = np.random.default_rng


def solved(name, query=QUERY):
    return load_planner(name).plan(query, RNG(0))


RIGHT = solved("astar")
LINE = solved("tangent")


def timed():
    mover = Cruising(radius=0.3, position=(5.0, 2.0), velocity=(0.0, 0.5))
    world = World("movers", (0, 0, 10, 10), (Disc(7.0, 7.0, 0.5),), movers=(mover,))
    task = Task(world, (1.0, 1.0, 0.0), (9.0, 9.0))
    query = Query.between(rasterise(world, 0.5, 0.25), task)
    motions = Trajectories.of(world, task.start[:2], 0).motions
    query = dataclasses.replace(query, motions=motions)
    return query, SafeIntervals().plan(query, RNG(0))


def with_cells(cells):
    """Return the valid plan with other cells and their cost."""
    return dataclasses.replace(RIGHT, cells=cells, cost=path_cost(cells, QUERY.grid.cell))


def test_a_valid_plan_is_unchanged_and_a_copy():
    for plan in (RIGHT, LINE):
        kept = validated(QUERY, plan)
        assert kept.cells is not plan.cells
        assert np.array_equal(kept.cells, plan.cells)
        assert np.array_equal(kept.line, plan.line)
    assert validate_plan(*timed()) == ""


class Unlocking(AStar):
    """A planner that makes the grid writable."""

    def plan(self, query, rng):
        query.grid.free.flags.writeable = True
        return super().plan(query, rng)


def test_a_planner_must_leave_the_grid_read_only():
    world = World("hall", (0.0, 0.0, 4.0, 4.0))
    query = Query.between(rasterise(world, 0.5, 0.25), Task(world, (1.0, 1.0, 0.0), (3.0, 3.0)))
    with pytest.raises(PlannerError, match="made the grid writable"):
        request_plan(Unlocking(), query, RNG(0))


@given(st.data())
def test_a_plan_that_was_changed_in_one_place_is_refused(data):
    cells, count = RIGHT.cells.copy(), len(RIGHT.cells)
    kind = data.draw(st.sampled_from(("drop", "jump", "swap", "price", "twice", "reverse", "cut")))
    k = data.draw(st.integers(1, count - 2))
    mutant = RIGHT
    if kind == "drop":
        mutant = with_cells(np.delete(cells, k, axis=0))
        # Beside a bend, the omitted cell may have been a mere detour.
        if np.abs(np.diff(mutant.cells, axis=0)).max() == 1:
            return
    elif kind == "jump":
        shift = data.draw(st.tuples(st.integers(-99, 99), st.integers(-99, 99)).filter(lambda s: max(map(abs, s)) > 2))
        cells[k] += np.array(shift, dtype=np.int32)
        mutant = with_cells(cells)
    elif kind == "swap":
        other = data.draw(st.integers(1, count - 2).filter(lambda j: abs(j - k) > 3))
        cells[[k, other]] = cells[[other, k]]
        mutant = with_cells(cells)
    elif kind == "price":
        off = data.draw(st.floats(1e-8, 1e3)) * data.draw(st.sampled_from((-1, 1)))
        mutant = dataclasses.replace(RIGHT, cost=RIGHT.cost * (1 + off))
    elif kind == "twice":
        mutant = with_cells(np.insert(cells, k, cells[k], axis=0))
    elif kind == "reverse":
        mutant = with_cells(cells[::-1])
    else:
        mutant = with_cells(cells[:k])
    assert validate_plan(QUERY, mutant)
    assert validated(QUERY, mutant).status is PlanStatus.INVALID
    assert not len(validated(QUERY, mutant).cells)


def test_the_first_invalid_step_is_named():
    cells = RIGHT.cells.copy()
    cells[3] += 5
    cells[7] += 5
    (r, c), (rr, cc) = cells[2], cells[3]
    assert (
        validate_plan(QUERY, with_cells(cells))
        == f"cells: step 2 from ({r}, {c}) to ({rr}, {cc}) does not lead to a neighbour"
    )


def test_a_move_that_the_grid_forbids_is_refused():
    grid = Grid.from_free([[True, False], [True, True]])
    query = Query(grid, (0, 0), (1, 1))
    diagonal = PlanResult(status=PlanStatus.SOLVED, cells=np.array([[0, 0], [1, 1]]), cost=math.sqrt(2))
    assert validate_plan(query, diagonal) == "cells: step 0 from (0, 0) to (1, 1) is no allowed move"
    around = PlanResult(status=PlanStatus.SOLVED, cells=np.array([[0, 0], [1, 0], [1, 1]]), cost=2.0)
    assert validate_plan(query, around) == ""
    assert validated(query, around).cells.dtype == np.int32


def test_a_negative_cell_is_outside_and_not_the_last_one():
    query = Query(Grid.from_free(np.ones((3, 3))), (0, 0), (0, 2))
    back = PlanResult(status=PlanStatus.SOLVED, cells=np.array([[0, 0], [0, -1], [0, 2]]), cost=2.0)
    assert "number 1, (0, -1), is outside" in validate_plan(query, back)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"status": "solved"}, "status: must be"),
        ({"status": PlanStatus.INVALID}, "status: must be"),
        ({"status": PlanStatus.NO_PATH}, "cells: given"),
        ({"cells": np.empty((0, 2), dtype=np.int32)}, "cells: none"),
        ({"cells": RIGHT.cells.tolist()}, "cells: must be an array of whole numbers"),
        ({"cells": RIGHT.cells.astype(float)}, "cells: must be an array of whole numbers"),
        ({"cells": RIGHT.cells.ravel()}, "cells: must be an array of whole numbers"),
        ({"cost": math.nan}, "cost: must be finite"),
        ({"cost": math.inf}, "cost: must be finite"),
        ({"cost": "1"}, "cost: must be a number"),
        ({"cost": None}, "cost: must be a number"),
        ({"length": 1.0}, "length: 1 m, but the cells are"),
        ({"work": 1.5}, "work: must be a whole number"),
        ({"wall_s": math.nan}, "wall_s: must be finite"),
        ({"reason": None}, "reason: must be text"),
        ({"options": None}, "options: must be a mapping"),
        ({"field": "none"}, "field: must be an array"),
        ({"field": np.zeros(3)}, "field: must be an array"),
        ({"history": None}, "history: must be a History"),
        ({"history": History(best=None)}, "history: best must be an array"),
        ({"history": History(best=np.ones((2, 2)))}, "history: best must be an array"),
        ({"history": History(best=np.ones(3))}, "history: iteration_best must be an array of numbers (3,)"),
    ],
    ids=lambda value: str(value)[:24],
)
def test_a_field_of_an_invalid_type_is_named(change, says):
    assert validate_plan(QUERY, dataclasses.replace(RIGHT, **change)).startswith(says)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda w: w[1:], "the first is not at the start"),
        (lambda w: w[:-1], "the last is not at the goal"),
        (lambda w: w[[0, -1]], "step 0 from .* does not keep 0.25 m"),
        (lambda w: np.insert(w, 1, (500.0, 500.0), axis=0), "does not keep"),
        (lambda w: np.insert(w, 1, math.nan, axis=0), "number 1 is not finite"),
        (lambda w: w[:, :1], "must be an array of numbers"),
    ],
    ids=["no start", "no goal", "through the trap", "out of bounds", "nan", "shape"],
)
def test_an_invalid_line_is_refused(change, says):
    mutant = dataclasses.replace(LINE, waypoints=change(LINE.waypoints))
    assert re.match(f"waypoints: .*{says}", validate_plan(QUERY, mutant))


@pytest.mark.parametrize("factor", [0.9, 1.001, math.nan, math.inf])
def test_a_line_of_another_length_is_refused(factor):
    assert validate_plan(QUERY, dataclasses.replace(LINE, length=LINE.length * factor)).startswith("length: ")


@pytest.mark.parametrize(
    "change",
    [
        lambda p: {"arrive": p.arrive[::-1]},
        lambda p: {"leave": p.arrive - 0.1},
        lambda p: {"arrive": p.arrive - 5, "leave": p.leave - 5},
        lambda p: {"arrive": np.full(len(p.cells), 1.0), "leave": np.full(len(p.cells), 1.0)},
        lambda p: {"arrive": p.arrive[:-1]},
        lambda p: {"arrive": np.where(p.arrive == p.arrive[3], np.nan, p.arrive)},
        lambda p: {"xy": p.xy + 0.1},
    ],
    ids=["backwards", "left before", "too early", "all at once", "one missing", "nan", "elsewhere"],
)
def test_times_that_do_not_increase_are_refused(change):
    query, plan = timed()
    assert validate_plan(query, dataclasses.replace(plan, **change(plan)))


def test_among_motions_a_plan_without_times_is_refused():
    query, plan = timed()
    assert isinstance(plan, TimedPlan)
    bare = PlanResult(status=PlanStatus.SOLVED, cells=plan.cells, cost=plan.cost)
    assert "needs a TimedPlan" in validate_plan(query, bare)


def test_a_path_from_an_end_that_cannot_be_used_is_refused():
    query = dataclasses.replace(QUERY, unreachable="no free cell near the start can be reached from it")
    assert "no free cell near the start" in validate_plan(query, RIGHT)


class Broken:
    """A planner that raises an exception or returns an invalid answer."""

    def __init__(self, answer):
        self.answer = answer

    def plan(self, query, rng):
        if isinstance(self.answer, BaseException):
            raise self.answer
        return self.answer


def test_a_planner_that_raises_is_named_with_the_place():
    line = Broken.plan.__code__.co_firstlineno + 2
    with pytest.raises(PlannerError) as error:
        request_plan(Broken(KeyError("row\n2")), QUERY, RNG(0), "mine")
    assert error.value.name == "mine"
    assert str(error.value) == f"planner mine raised KeyError: 'row\\n2' (test_validation.py:{line})"
    assert isinstance(error.value.__cause__, KeyError)


def test_the_place_is_in_the_planners_module_and_not_in_what_it_calls():
    class Caller(Broken):
        def plan(self, query, rng):
            return np.linalg.inv(np.zeros((2, 2)))

    with pytest.raises(
        PlannerError, match=rf"LinAlgError.*test_validation.py:{Caller.plan.__code__.co_firstlineno + 1}"
    ):
        request_plan(Caller(None), QUERY, RNG(0))


@pytest.mark.parametrize("answer", [None, 3, RIGHT.cells, (RIGHT,)], ids=["None", "3", "cells", "tuple"])
def test_an_answer_that_is_no_plan_result_is_a_planner_error(answer):
    with pytest.raises(PlannerError, match=r"planner Broken returned .* instead of a PlanResult \(test_validation.py:"):
        request_plan(Broken(answer), QUERY, RNG(0))


class Unprintable(Exception):
    """An exception that cannot be formatted, and whose class is hidden."""

    def __str__(self):
        raise GeneratorExit

    __repr__ = __str__
    __class__ = property(__str__)


class Halting(BaseException):
    """An exception that no `except Exception` catches."""


RAISED = {
    "SystemExit: 0": SystemExit(0),
    "GeneratorExit": GeneratorExit(),
    "StopIteration: 3": StopIteration(3),
    "KeyboardInterrupt": KeyboardInterrupt(),
    "MemoryError": MemoryError(),
    "Halting: mine": Halting("mine"),
    "Unprintable": Unprintable("no text"),
    "ValueError: a\\nb\\x1b[31m": ValueError("a\nb\x1b[31m"),
    f"ValueError: {'x' * 197}...": ValueError("x" * 100_000),
}


@pytest.mark.parametrize("said", RAISED)
def test_anything_that_a_planner_raises_is_a_planner_error_of_one_line(said):
    with pytest.raises(PlannerError) as error:
        request_plan(Broken(RAISED[said]), QUERY, RNG(0))
    line = Broken.plan.__code__.co_firstlineno + 2
    assert str(error.value) == f"planner Broken raised {said} (test_validation.py:{line})"


def test_endless_recursion_is_a_planner_error():
    class Recursing(Broken):
        def plan(self, query, rng):
            return self.plan(query, rng)

    with pytest.raises(PlannerError, match="planner Recursing raised RecursionError: maximum"):
        request_plan(Recursing(None), QUERY, RNG(0))


class Hidden:
    """An object that claims to be a plan and has no text."""

    __class__ = PlanResult

    def __repr__(self):
        raise ValueError


class Lazy(PlanResult):
    """A plan whose path raises an exception."""

    @property
    def cells(self):
        raise KeyError("cells")


def test_an_answer_that_only_looks_like_a_plan_is_a_planner_error():
    with pytest.raises(PlannerError, match=r"returned a Hidden instead of a PlanResult \(test_validation.py:"):
        request_plan(Broken(Hidden()), QUERY, RNG(0))
    lazy = object.__new__(Lazy)
    vars(lazy).update({key: value for key, value in vars(RIGHT).items() if key != "cells"})
    with pytest.raises(PlannerError, match=r"planner Broken raised KeyError: 'cells' \(test_validation.py:"):
        request_plan(Broken(lazy), QUERY, RNG(0))
    with pytest.raises(PlannerError, match=r"planner Broken raised ValueError \(test_validation.py:"):
        request_plan(Broken(dataclasses.replace(RIGHT, options={"x": Hidden()})), QUERY, RNG(0))


@pytest.mark.parametrize(
    "key", ["status", "cells", "waypoints", "cost", "work", "reason", "options", "history", "field"]
)
def test_a_field_without_a_text_is_named_by_its_type(key):
    problem = validated(QUERY, dataclasses.replace(RIGHT, **{key: Hidden()})).reason
    assert problem.startswith(f"{key}: must be")
    assert problem.endswith("got a Hidden")


def test_the_reason_of_a_plan_is_one_line():
    no_path = PlanResult(status=PlanStatus.NO_PATH, reason="a\nb\x1b[31m" + "x" * 999)
    reason = validated(QUERY, no_path).reason
    assert reason.startswith("a\\nb\\x1b[31mxxx")
    assert len(reason) < 250


def test_capabilities_that_raise_are_a_planner_error():
    class Secretive(Broken):
        @property
        def capabilities(self):
            raise RuntimeError("secret")

    with pytest.raises(PlannerError, match=r"planner Secretive raised RuntimeError: secret \(test_validation.py:"):
        capabilities_of(Secretive(None))


def test_a_planner_that_only_declares_iterations_is_named():
    planner = Broken(RIGHT)
    planner.capabilities = Capabilities(iterative=True)
    with pytest.raises(PlannerError, match="planner Broken declares itself iterative, but lacks iterate, iterations"):
        as_iterative(planner)


@pytest.mark.parametrize(("method", "wanted"), [("replanner", "Replanner"), ("agent", "OnlineAgent")])
def test_a_replanner_or_agent_of_the_wrong_kind_is_named_with_what_it_lacks(method, wanted):
    planner = Broken(RIGHT)
    planner.capabilities = Capabilities(own_replanner=method == "replanner", cell_by_cell=method == "agent")
    setattr(planner, method, lambda query, rng: None)
    make = replanner_for if method == "replanner" else agent_for
    with pytest.raises(PlannerError, match=f"planner Broken returned None instead of a {wanted}; it lacks .*move"):
        make(planner, QUERY, RNG(0))


def test_a_grid_planner_whose_search_returns_nothing_is_named():
    class Empty(GridPlanner):
        def search(self, query, rng):
            return None

    with pytest.raises(
        PlannerError, match=r"planner Empty returned None instead of a PlanResult \(test_validation.py:"
    ):
        request_plan(Empty(), QUERY, RNG(0))


def test_a_planner_error_can_be_pickled():
    with pytest.raises(PlannerError) as error:
        request_plan(Broken(KeyError("row\n2")), QUERY, RNG(0), "mine")
    copy = pickle.loads(pickle.dumps(error.value))
    assert (str(copy), copy.name, copy.problem) == (str(error.value), "mine", error.value.problem)


def test_input_errors_sigterm_and_ctrl_c_pass_through(signals):
    for error in (InputError("query: has no task"), Terminated(143)):
        with pytest.raises(type(error)):
            request_plan(Broken(error), QUERY, RNG(0))

    class Interrupted(Broken):
        def plan(self, query, rng):
            signal.raise_signal(signal.SIGINT)

    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        request_plan(Interrupted(None), QUERY, RNG(0))
    assert signal.getsignal(signal.SIGINT) is before
