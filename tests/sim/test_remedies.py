"""Whatever a reason for a missing path says: named remedies lead to paths, and sizes agree with a flood of points."""

import re
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from antdrive.base.errors import FieldError
from antdrive.planners import PlanStatus
from antdrive.robots import Footprint, load_robot
from antdrive.sim import Scenario, plan
from antdrive.worlds import Disc, Task, World

STEP = 0.02  # of the field of points [m]
OPTION = r"(?:-p \w+|--(?:cell|margin|footprint|goal|start) [\w.,-]+)"
REMEDY = re.compile(rf"(?:^|; )({OPTION}(?: {OPTION})*) finds one")
WIDEST = re.compile(r"the widest disc that passes has a radius of ([\d.e-]+) m")
CHANCES = {
    "robot": ("turtlebot", "turtlebot", "jackal", "husky", "cart"),
    "planner": ("astar", "astar", "astar", "tangent", "apf", "mmas"),
    "cell": (0.6, 0.5, 0.25, 0.1),
    "margin": (None, None, 0.1, 0.3),
    "footprint": ("auto", "auto", "disc", "exact"),
    "kind": ("shelf", "corner", "door", "dead end", "start", "scattered"),
}


def world_of(kind, rng):
    """Return a world of 6 x 4 m with something narrow at the goal, at the start or between them."""
    start, goal, discs = (1.2, 2.0), (4.8, 2.0), []
    near = rng.uniform(0.05, 0.5)
    if kind == "shelf":
        goal = (6 - near, float(rng.uniform(0.6, 3.4)))
    elif kind == "corner":
        goal = (6 - near, 4 - float(rng.uniform(0.05, 0.5)))
    elif kind == "start":
        start = (float(rng.uniform(0.19, 0.6)), float(rng.uniform(0.6, 3.4)))
        discs = [Disc(start[0] + 0.3 + float(rng.uniform(0.2, 0.6)), start[1] + float(rng.uniform(-0.2, 0.2)), 0.25)]
    elif kind == "door":
        half, at = float(rng.uniform(0.1, 0.5)), float(rng.uniform(1.2, 2.8))
        ys = np.arange(0.25, 3.0, 0.3)
        discs = [Disc(3.0, float(y), 0.25) for y in (*(at + half + ys), *(at - half - ys)) if -0.2 < y < 4.2]
    elif kind == "dead end":
        half = float(rng.uniform(0.15, 0.5))
        xs = np.arange(3.6, 5.6, 0.25)
        discs = [Disc(float(x), 2 + side * (half + 0.2), 0.2) for x in xs for side in (-1, 1)]
        discs.append(Disc(5.5, 2.0, 0.3))
    else:
        places = rng.uniform((0.3, 0.2), (5.7, 3.8), (30, 2)).tolist()
        discs = [Disc(x, y, float(rng.uniform(0.1, 0.25))) for x, y in places]
        discs = [
            d for d in discs if np.hypot(d.x - 1.2, d.y - 2) > 0.8 and np.hypot(d.x - 4.8, d.y - 2) > d.radius + near
        ]
    tolerance = float(rng.choice((0.1, 0.25, 0.5)))
    return Task(World(kind, (0.0, 0.0, 6.0, 4.0), tuple(discs)), (*start, 0.0), goal, tolerance)


def drawn(seed):
    """Draw a scenario; None if its robot does not fit at the start."""
    rng = np.random.default_rng([seed, 26])
    one = {key: values[rng.integers(len(values))] for key, values in CHANCES.items()}
    cart = replace(load_robot("jackal"), name="cart", footprint=Footprint.rectangle(0.9, 0.6))
    robot = cart if one["robot"] == "cart" else load_robot(one["robot"])
    settings = {key: one[key] for key in ("cell", "margin", "footprint")}
    if one["planner"] == "tangent" or one["planner"] == "apf":
        settings["footprint"] = "auto"
    options = {"iterations": 2, "ants": 4} if one["planner"] == "mmas" else None
    try:
        return Scenario.of(world_of(one["kind"], rng), one["planner"], robot, options=options, **settings)
    except FieldError:
        return None


def applied(s, options):
    """Return the scenario with options as typed on the command line."""
    words = options.split()
    for flag, value in zip(words[::2], words[1::2], strict=True):
        numbers = tuple(map(float, value.split(","))) if re.match(r"[\d-]", value) else ()
        if flag == "-p":
            kept = {key: getattr(s, key) for key in ("cell", "margin", "footprint")}
            s = Scenario.of(s.task, value, s.robot, **kept)
        elif flag in ("--goal", "--start"):
            s = replace(s, task=replace(s.task, **{flag[2:]: numbers}))
        else:
            s = replace(s, **{flag[2:]: numbers[0] if numbers else value})
    return s


def flooded(task, radius, lead):
    """Return whether a disc gets from near the start to the goal, over a field of points.

    An end with less room joins a position by a straight line, of at most `lead` from the start, the tolerance to the goal.
    """
    from scipy import ndimage

    xmin, ymin, xmax, ymax = task.world.bounds
    px, py = np.meshgrid(np.arange(xmin, xmax, STEP), np.arange(ymin, ymax, STEP))

    def room_at(x, y):
        room = np.minimum.reduce([x - xmin, xmax - x, y - ymin, ymax - y])
        for disc in task.world.obstacles:
            room = np.minimum(room, np.hypot(x - disc.x, y - disc.y) - disc.radius)
        return room

    parts, _ = ndimage.label(room_at(px, py) >= radius, np.ones((3, 3)))

    def parts_at(end, reach):
        own = float(room_at(*np.array(end)[:, None])[0])
        reach = STEP if own >= radius else reach
        near = (np.hypot(px - end[0], py - end[1]) <= reach) & (parts > 0)
        x, y = px[near], py[near]
        along = np.linspace(0, 1, 50)[:, None]
        clear = room_at(end[0] + along * (x - end[0]), end[1] + along * (y - end[1])).min(axis=0)
        return set(parts[near][clear >= min(own, radius) - 1e-6].tolist())

    return bool(parts_at(task.start[:2], lead) & parts_at(task.goal, task.goal_tolerance))


def checked(seed, counts):
    """Check all that a scenario's reason says."""
    s = drawn(seed)
    if s is None:
        counts["no start"] += 1
        return
    grid, answer = plan(s)
    if answer.status is not PlanStatus.NO_PATH or "at the start would bring" in answer.reason:
        counts["narrow start" if "would bring" in answer.reason else answer.status.name] += 1
        return
    reason, remedy, widest = answer.reason, REMEDY.search(answer.reason), WIDEST.search(answer.reason)
    counts["no path"] += 1
    if remedy:
        _, again = plan(applied(s, remedy[1]))
        assert again.solved, f"{seed}: {remedy[1]}: {reason}; now: {again.reason}"
        counts[re.sub(r" [\d.,-]+", "", remedy[1])] += 1
    else:
        assert "finds one" not in reason, reason
        counts["no remedy"] += 1
    lead = np.sqrt(2) * (max(3, np.ceil(s.inflate / grid.cell) + 1) + 0.5) * grid.cell
    if widest:
        counts["widest"] += 1
        assert not flooded(s.task, float(widest[1]) + 2 * STEP, lead), f"{seed}: {reason}"
        assert float(widest[1]) < 3 * STEP or flooded(s.task, float(widest[1]) - 2 * STEP, lead), f"{seed}: {reason}"
    if "close off the goal" in reason:
        assert not flooded(s.task, 2 * STEP, lead), f"{seed}: {reason}"
    if "does not fit" in reason:
        counts["does not fit"] += 1
        assert widest, reason
        assert float(widest[1]) <= s.robot.radius + 1e-3, reason
        assert remedy is None or remedy[1].startswith(("--goal", "--start", "-p astar --goal", "-p astar --start")), (
            reason
        )


def test_whatever_a_reason_says_holds():
    counts = Counter()
    for seed in range(22):
        checked(seed, counts)
    assert counts["no path"] > 5
    assert counts["no remedy"] < counts["no path"]


@pytest.mark.slow
def test_whatever_a_reason_says_holds_in_many_worlds():
    counts = Counter()
    for seed in range(1000, 1300):
        checked(seed, counts)
    assert counts["does not fit"] > 5
    assert counts["widest"] > 50
