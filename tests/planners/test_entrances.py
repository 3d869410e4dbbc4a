"""Entrances of grids with turns against a search in plain Python, whose leads are sampled."""

import collections
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.base import FieldError
from antdrive.planners._kernels_entrances import entrances
from antdrive.planners.entrances import LEAD, MAX_BACKWARDS, ROOM, TURNING, clear_turn, ends, lead_heading
from antdrive.worlds import DIRECTIONS, Disc, Task, World, rasterise
from antdrive.worlds.geometry import point_clearance, segment_clearance
from tests.worlds.headings.oracle import BAND, OUTLINES, gap, sampled

SIDE = 4.0  # of the worlds [m]
STEP = math.pi / 4
SHAPES = ("rectangle", "rectangle ahead of the axle", "triangle", "axle in the rounding")
CLEAR, NEAR, BLOCKED = 1, 0, -1


def certainty(least, slack):
    return CLEAR if least > slack + BAND else BLOCKED if least < -BAND else NEAR


def turned(outline, x, y, yaw, turn, around):
    return certainty(*sampled(outline, x, y, yaw, yaw + turn, *around))


def turned_to(outline, x, y, yaw, heading, around):
    """The better way round."""
    short = math.remainder(heading - yaw, 2 * math.pi)
    other = short - math.copysign(2 * math.pi, short)
    return max(turned(outline, x, y, yaw, turn, around) for turn in (short, other))


def led(outline, start, to, backwards, around):
    """The heading of a lead, and whether it is clear."""
    x, y, yaw = start
    if math.dist((x, y), to) < 1e-6:
        return yaw, CLEAR
    heading = math.atan2(to[1] - y, to[0] - x) + (math.pi if backwards else 0.0)
    share = np.linspace(0, 1, 101)
    least = gap(outline, x + share * (to[0] - x), y + share * (to[1] - y), heading, *around).min()
    straight = certainty(least, math.dist((x, y), to) / 200)
    return heading, straight if straight == BLOCKED else min(straight, turned_to(outline, x, y, yaw, heading, around))


def free_near(grid, point, within):
    """Free cells (row, col) within a distance, nearest first."""
    cells = [(math.dist(grid.xy([at])[0], point), *at) for at in np.argwhere(grid.free).tolist()]
    return [(row, col) for away, row, col in sorted(cells) if away <= within]


def leading_to(grid, cell):
    """Nodes from which moves lead to a cell, by a search against them."""
    into = collections.defaultdict(list)
    cols = grid.shape[1]
    for node, flat in enumerate(grid.turns.cell.tolist()):
        for k, (dr, dc) in enumerate(DIRECTIONS):
            if grid.turns.moves[node] >> k & 1:
                into[int(grid.turns.label[flat + dr * cols + dc, k])].append(node)
    found = set(grid.nodes_at(cell))
    queue = list(found)
    while queue:
        for node in into[queue.pop()]:
            if node not in found:
                found.add(node)
                queue.append(node)
    return found


def possible_nodes(grid, task, leading, around):
    """The nodes that may be the entrance: those of near leads, up to the first clear one; -1 if there is none."""
    outline, (x, y, yaw) = grid.turns.outline, task.start
    room = float(gap(outline, x, y, yaw, *around)[0])
    own = outline if room > 0 else outline._replace(reach=outline.reach + room - ROOM)
    cells = free_near(grid, (x, y), LEAD)
    if not cells:
        return {-1}
    if not any(leading & set(grid.nodes_at(cell)) for cell in cells):
        return set(grid.nodes_at(cells[0]))
    found = set()
    for most, backwards in ((LEAD, False), (MAX_BACKWARDS, True)):

        def effort(cell, backwards=backwards):
            dx, dy = grid.xy([cell])[0] - (x, y)
            turn = abs(math.remainder(math.atan2(dy, dx) + math.pi * backwards - yaw, 2 * math.pi))
            return math.hypot(dx, dy) + (TURNING * turn if math.hypot(dx, dy) > ROOM else 0.0)

        for cell in sorted(cells, key=effort):
            to = grid.xy([cell])[0].tolist()
            labels = grid.turns.label[cell[0] * grid.shape[1] + cell[1]].tolist()
            if math.dist(to, (x, y)) > most or not leading & set(labels):
                continue
            heading, lead = led(own, task.start, to, backwards, around)
            for side in (math.floor(heading / STEP), math.ceil(heading / STEP)):
                if lead == BLOCKED or labels[side % 8] not in leading:
                    continue
                sure = min(lead, turned(own, *to, heading, side * STEP - heading, around))
                if sure != BLOCKED:
                    found.add(labels[side % 8])
                if sure == CLEAR:
                    return found
    return found | {-1}


def random_case(seed):
    """A task whose start is clear without the margin and tight, its grid and its obstacles."""
    rng = np.random.default_rng(seed)
    bare = OUTLINES[SHAPES[seed % len(SHAPES)]]
    discs = [
        Disc(*rng.uniform(0, SIDE, 2).tolist(), float(rng.uniform(0.03, 0.15))) for _ in range(rng.integers(5, 30))
    ]
    world = World("random", (0.0, 0.0, SIDE, SIDE), tuple(discs))
    around = world.discs, world.bounds
    outline = bare._replace(reach=bare.reach + float(rng.uniform(0.0, 0.1)))
    grid = rasterise(world, float(rng.choice([0.1, 0.15])), 0.7, outline)
    while True:
        start = (*rng.uniform(0.2, SIDE - 0.2, 2).tolist(), float(rng.uniform(-4, 4)))
        if 0.001 < gap(bare, *start, *around)[0] < 0.15:
            try:
                return Task(world, start, tuple(rng.uniform(0, SIDE, 2).tolist())), grid, around
            except FieldError:  # the goal is in a disc
                continue


def answers(seeds):
    """The ends of random tasks: the number of each kind, and those that the oracle does not allow."""
    kinds, wrong = collections.Counter(), []
    for seed in seeds:
        task, grid, around = random_case(seed)
        within = 0.3
        node, goal = ends(grid, task, within)
        goals = free_near(grid, task.goal, within)
        leading = [leading_to(grid, cell) for cell in goals]
        nodes = possible_nodes(grid, task, set().union(*leading), around)
        first = next((cell for cell, some in zip(goals, leading, strict=True) if node in some), (goals or [None])[0])
        expected = -1 if first is None else first[0] * grid.shape[1] + first[1]
        if node not in nodes or goal != expected:
            wrong.append((seed, (node, goal), (nodes, expected)))
        kinds[node >= 0, goal >= 0] += 1
    return kinds, wrong


@pytest.mark.parametrize(
    ("seeds", "seen"),
    [
        (range(9), [(True, True)]),
        pytest.param(range(1000, 1100), [(True, True), (False, True), (True, False)], marks=pytest.mark.slow),
    ],
    ids=["few", "many"],
)
def test_ends_are_those_of_the_search_in_plain_python(seeds, seen):
    kinds, wrong = answers(seeds)
    assert not wrong
    assert min(kinds[kind] for kind in seen) >= 3


def test_leads_and_turns_are_clear_where_samples_are():
    seen = collections.Counter()
    for seed in range(30):
        task, _, around = random_case(seed)
        outline, rng = OUTLINES[SHAPES[seed % len(SHAPES)]], np.random.default_rng(seed)
        for backwards in (False, True):
            to = (np.array(task.start[:2]) + rng.uniform(-0.5, 0.5, 2)).tolist()
            heading, lead = led(outline, task.start, to, backwards, around)
            found = lead_heading(task.start, *to, outline, task.world, backwards=backwards)
            turn = clear_turn(task.start, heading, outline, task.world)
            assert math.isnan(found) or math.isclose(math.remainder(found - heading, 2 * math.pi), 0.0, abs_tol=1e-9)
            for sure, angle in ((lead, found), (turned_to(outline, *task.start, heading, around), turn)):
                assert sure == NEAR or math.isfinite(angle) == (sure == CLEAR)
                seen[sure] += 1
            if math.isfinite(turn):
                assert math.isclose(math.remainder(task.start[2] + turn - heading, 2 * math.pi), 0.0, abs_tol=1e-9)
    assert min(seen[CLEAR], seen[BLOCKED]) >= 30


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.sampled_from((3, 30)))
def test_the_cell_of_an_end_is_the_nearest_that_a_clear_line_reaches(seed, reach):
    """Posts hide most cells, so dozens are tried."""
    rng = np.random.default_rng(seed)
    discs = np.column_stack((rng.uniform(0.0, 3.0, (40, 2)), rng.uniform(0.02, 0.1, 40)))
    world, cell = World("posts", (-1.0, -1.0, 4.0, 4.0), tuple(Disc(*row) for row in discs)), 0.1
    places = rng.uniform(0.5, 2.5, (60, 2))
    ends = places[point_clearance(world, places).argsort()[-2:]]
    free, own = rng.random((30, 30)) < 0.08, point_clearance(world, ends)
    inflate = 0.97 * own.min()  # so that most lines come too close to a post
    found = entrances(free, 0.0, 0.0, cell, inflate, reach, ends, 0.4, world.discs, np.array(world.bounds))
    cells = np.argwhere(free)
    centres = cells[:, ::-1] * cell
    for end, (row, col, usable) in enumerate(found.tolist()):
        away = np.hypot(*(centres - ends[end]).T)
        clear = segment_clearance(world, centres, np.tile(ends[end], (len(cells), 1))) >= min(inflate, own[end]) - 1e-9
        clear &= np.abs(cells - np.floor(ends[end, ::-1] / cell + 0.5)).max(axis=1) <= reach
        if end == 1 and own[end] < inflate:
            clear &= away <= 0.4
        assert usable == clear.any()
        if usable:
            assert [row, col] == cells[clear][away[clear].argmin()].tolist()
