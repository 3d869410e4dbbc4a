"""Positions of movers against independent oracles and their files."""

import dataclasses
import json
import math
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.base import FieldError, InputError
from antdrive.worlds import (
    Cruising,
    Disc,
    Keyframed,
    Task,
    Trajectories,
    Wandering,
    World,
    load_task,
    save_task,
    task_from_dict,
    task_to_dict,
)
from antdrive.worlds.geometry import segment_clearance

BOX = (0.0, 0.0, 10.0, 8.0)
START = (1.0, 1.0)
ELL = ((1.0, 2.0, 2.0), (3.0, 6.0, 2.0), (4.0, 6.0, 4.0))  # 2 m/s east from t = 1, then 2 m/s north
FINE = np.linspace(0, 40, 4001)


def trajectories(*movers, seed=0, obstacles=()):
    return Trajectories.of(World("w", BOX, tuple(obstacles), movers=movers), START, seed)


def at(mover, t):
    return trajectories(mover).positions(t)[:, 0]


# Keyframes


@pytest.mark.parametrize("loop", ["pingpong", "teleport", "once"])
@pytest.mark.parametrize("interpolation", ["linear", "catmull-rom"])
def test_a_mover_whose_keyframes_are_all_at_one_place_stands_still(loop, interpolation):
    mover = Keyframed(radius=0.3, keyframes=((0.0, 2.0, 3.0), (4.0, 2.0, 3.0)), loop=loop, interpolation=interpolation)
    moving = trajectories(mover)
    assert (moving.positions(FINE) == (2.0, 3.0)).all()
    assert not moving.velocities(FINE).any()
    assert not moving.travel(FINE).any()
    assert not moving.jumps(FINE).any()
    assert moving.jump_times(40.0)[0].size == 0
    task = Task(World("w", BOX, movers=(mover,)), (1.0, 1.0, 0.0), (9.0, 7.0))
    assert task_from_dict(task_to_dict(task)) == task


def walk(mover, t):
    """An oracle: where a keyframed mover is, lap by lap."""
    frames = list(mover.keyframes)
    t = t + mover.phase
    if t <= frames[0][0]:
        return frames[0][1:]
    first, last = frames[0][0], frames[-1][0]
    while t > last:
        if mover.loop == "once":
            return frames[-1][1:]
        t -= last - first
        if mover.loop == "pingpong":
            frames = [(first + last - when, x, y) for when, x, y in reversed(frames)]
    return tuple(float(np.interp(t, [f[0] for f in frames], [f[k] for f in frames])) for k in (1, 2))


places = st.tuples(st.floats(-50, 50), st.floats(-50, 50))


@st.composite
def keyframed(draw, loops=("pingpong", "teleport", "once"), interpolation="linear"):
    gaps = draw(st.lists(st.floats(10.0, 20.0), min_size=1, max_size=5))
    times = np.cumsum([draw(st.floats(0, 3)), *gaps]).tolist()
    spots = draw(st.lists(places, min_size=len(times), max_size=len(times)).filter(lambda p: len(set(p)) > 1))
    frames = tuple((t, x, y) for t, (x, y) in zip(times, spots, strict=True))
    phase = draw(st.floats(0, 20))
    return Keyframed(
        radius=0.3, keyframes=frames, loop=draw(st.sampled_from(loops)), interpolation=interpolation, phase=phase
    )


@given(keyframed(), st.lists(st.floats(0, 300), min_size=1, max_size=20))
def test_linear_keyframes_are_walked(mover, times):
    cut = mover.keyframes[-1][0] - mover.keyframes[0][0]
    times = [t for t in times if abs((t + mover.phase - mover.keyframes[0][0]) % cut) > 1e-6]
    for t in times:
        assert at(mover, t)[0] == pytest.approx(walk(mover, t), abs=1e-8)


def test_before_the_first_keyframe_and_after_the_last_it_stands():
    mover = Keyframed(radius=0.3, keyframes=ELL, loop="once")
    assert at(mover, [0.0, 0.5, 1.0]).tolist() == [[2, 2]] * 3
    assert at(mover, [4.0, 5.0, 99.0]).tolist() == [[6, 4]] * 3
    velocity = trajectories(mover).velocities([0.5, 1.0, 3.0, 3.5, 4.0])[:, 0]
    np.testing.assert_allclose(velocity, [(0, 0), (2, 0), (0, 2), (0, 2), (0, 0)])


def test_teleport_appears_at_the_first_place_and_says_when():
    mover = Keyframed(radius=0.3, keyframes=ELL, loop="teleport")
    moving = trajectories(mover)
    assert moving.jump_times(10.5)[0].tolist() == [4.0, 7.0, 10.0]
    np.testing.assert_allclose(at(mover, [3.999, 4.0, 4.5]), [(6, 3.998), (2, 2), (3, 2)])
    t = np.arange(0, 11, 0.25)
    assert t[1:][moving.jumps(t)[:, 0]].tolist() == [4.0, 7.0, 10.0]
    later = trajectories(dataclasses.replace(mover, phase=3.5))
    assert later.jump_times(4.0)[0].tolist() == [0.5, 3.5]


@pytest.mark.parametrize(("loop", "frames"), [("pingpong", ELL), ("once", ELL), ("teleport", (*ELL, (6.0, 2.0, 2.0)))])
def test_only_teleporting_loops_that_are_not_closed_jump(loop, frames):
    moving = trajectories(Keyframed(radius=0.3, keyframes=frames, loop=loop))
    assert not moving.jumps(FINE).any()
    assert len(moving.jump_times(40)[0]) == 0


@given(keyframed(interpolation="catmull-rom"))
def test_the_cubic_goes_through_every_place(mover):
    mover = dataclasses.replace(mover, phase=0.0)
    knots = [frame[0] for frame in mover.keyframes[:-1]]
    np.testing.assert_allclose(at(mover, knots), [frame[1:] for frame in mover.keyframes[:-1]], atol=1e-6)


def test_the_cubic_has_the_tangents_of_catmull_and_rom():
    mover = Keyframed(radius=0.3, keyframes=ELL, loop="once", interpolation="catmull-rom")
    # The tangent at a place is half the way from the one before to the one after: (4, 2) / 2 at the corner.
    eps = 1e-6
    before, after = (at(mover, 3 + eps) - at(mover, 3.0))[0] / eps, (at(mover, 3.0) - at(mover, 3 - eps))[0] / eps
    np.testing.assert_allclose(after, np.array([2.0, 1.0]) / 2, atol=1e-4)  # the segment before lasts 2 s
    np.testing.assert_allclose(before, np.array([2.0, 1.0]) / 1, atol=1e-4)
    assert np.ptp(at(mover, FINE)[:, 1]) > 2.0  # the cubic overshoots


# Straight on


def bounced(mover, t):
    """An oracle: where a cruising mover is, wall by wall."""
    x, v = list(mover.position), list(mover.velocity)
    left = t + mover.phase
    for k in range(2):
        low, high, rest = BOX[k] + mover.radius, BOX[k + 2] - mover.radius, left
        while v[k] != 0:
            until = ((high if v[k] > 0 else low) - x[k]) / v[k]
            if until >= rest:
                x[k] += v[k] * rest
                break
            x[k], v[k], rest = (high if v[k] > 0 else low), -v[k], rest - until
    return x, v


@given(
    st.floats(0.3, 9.7), st.floats(0.3, 7.7), st.floats(-3, 3), st.floats(-3, 3).filter(lambda v: abs(v) > 0.01),
    st.floats(0, 20), st.floats(0, 60),
)  # fmt: skip
def test_a_cruising_mover_bounces_like_a_ball(x, y, vx, vy, phase, t):
    mover = Cruising(radius=0.3, position=(x, y), velocity=(vx, vy), phase=phase)
    place, velocity = bounced(mover, t)
    assert at(mover, t)[0] == pytest.approx(place, abs=1e-9)
    rim = np.array([(0.3, 0.3), (9.7, 7.7)])
    if np.abs(rim - place).min() > 1e-6:
        assert trajectories(mover).velocities(t)[0, 0] == pytest.approx(velocity)


def test_at_the_wall_it_already_comes_back():
    mover = Cruising(radius=0.5, position=(7.5, 4.0), velocity=(2.0, 0.0))
    assert trajectories(mover).velocities([0.999, 1.0, 1.5])[:, 0, 0].tolist() == [2, -2, -2]
    back = Cruising(radius=0.5, position=(2.5, 4.0), velocity=(-2.0, 0.0))
    assert trajectories(back).velocities([0.999, 1.0, 1.5])[:, 0, 0].tolist() == [-2, 2, 2]


# Wandering

POSTS = tuple(Disc(2.25 + 1.5 * i, 1.75 + 1.5 * j, 0.35) for i in range(5) for j in range(4))


@pytest.mark.parametrize("seed", range(4))
def test_a_wanderer_goes_from_cell_to_free_neighbouring_cell(seed):
    mover = Wandering(radius=0.2, cell=0.5, period=0.4)
    moving = trajectories(mover, seed=seed, obstacles=POSTS)
    stops = moving.positions(np.arange(300) * 0.4)[:, 0]
    cells = (stops - 0.25) / 0.5
    assert np.abs(cells - cells.round()).max() < 1e-9
    steps = np.abs(np.diff(cells.round(), axis=0)).max(axis=1)
    assert (steps <= 1).all()
    assert (steps == 1).mean() > 0.9
    assert len({tuple(step) for step in np.diff(cells.round(), axis=0)}) == 8
    world = World("w", BOX, POSTS)
    assert (segment_clearance(world, stops[:-1], stops[1:]) > mover.radius).all()
    assert math.dist(stops[0], START) - mover.radius >= 1.0
    middle = moving.positions([0.2])[0, 0]
    np.testing.assert_allclose(middle, (stops[0] + stops[1]) / 2)


def test_a_wanderer_that_is_boxed_in_waits():
    ring = [Disc(5.25 + dx, 4.25 + dy, 0.2) for dx in (-0.5, 0, 0.5) for dy in (-0.5, 0, 0.5) if (dx, dy) != (0, 0)]
    mover = Wandering(radius=0.2, cell=0.5, period=0.4, start=(5.3, 4.1))
    moving = trajectories(mover, obstacles=ring)
    assert (moving.positions(FINE)[:, 0] == (5.25, 4.25)).all()
    assert (moving.velocities(FINE) == 0).all()


def test_wanderers_draw_from_the_runs_seed_unless_they_have_one_of_their_own():
    own, shared = (Wandering(radius=0.2, cell=0.5, period=0.4, seed=seed) for seed in (7, None))
    one, other = (trajectories(own, shared, shared, seed=seed).positions(FINE) for seed in (0, 1))
    assert (one[:, 0] == other[:, 0]).all()
    assert (one[:, 1] != other[:, 1]).any()
    assert (one[:, 1] != one[:, 2]).any()
    assert (one == trajectories(own, shared, shared, seed=0).positions(FINE)).all()


# All kinds

KINDS = [
    *(Keyframed(radius=0.3, keyframes=ELL, loop=loop, phase=0.7) for loop in ("pingpong", "teleport", "once")),
    *(
        Keyframed(radius=0.3, keyframes=ELL, loop=loop, interpolation="catmull-rom")
        for loop in ("pingpong", "teleport")
    ),
    Cruising(radius=0.3, position=(3.0, 4.0), velocity=(1.3, -0.7), phase=2.0),
    Wandering(radius=0.2, cell=0.5, period=0.4, phase=1.1),
]


@pytest.mark.parametrize("mover", KINDS, ids=lambda m: f"{type(m).__name__} {getattr(m, 'loop', '')}")
def test_velocity_is_the_change_of_place_and_travel_is_never_less(mover):
    moving = trajectories(mover)
    t = np.linspace(0, 20, 20001)
    places, velocity = moving.positions(t)[:, 0], moving.velocities(t)[:, 0]
    moved, jumped = np.diff(places, axis=0), moving.jumps(t)[:, 0]
    error = np.abs(moved / np.diff(t)[:, None] - (velocity[:-1] + velocity[1:]) / 2).max(axis=1)
    assert np.mean(error > 0.01) < 0.01  # velocity is undefined at corners
    assert (np.hypot(*moved.T) <= moving.travel(t)[:, 0] + 1e-12)[~jumped].all()
    coarse = t[::500]
    length = np.add.reduceat(np.hypot(*moved.T) * ~jumped, np.arange(0, 20000, 500))
    assert (length <= moving.travel(coarse)[:, 0] + 1e-9).all()
    assert jumped.sum() == len(moving.jump_times(20)[0])


def test_a_time_has_the_same_bits_whatever_other_times_are_requested():
    moving = trajectories(*KINDS)
    whole = moving.positions(FINE)
    assert (whole[::7] == moving.positions(FINE[::7])).all()
    assert (whole[1234] == moving.positions(FINE[1234])[0]).all()


def test_the_bits_are_the_same_in_another_process(tmp_path):
    task = Task(World("w", BOX, POSTS, movers=tuple(KINDS)), (*START, 0.0), (9.0, 7.0))
    save_task(task, tmp_path / "w.yaml")
    code = (
        "import sys, hashlib, numpy as np\n"
        "from antdrive.worlds import Trajectories, load_task\n"
        "task = load_task(sys.argv[1])\n"
        "places = Trajectories.of(task.world, task.start[:2], 5).positions(np.linspace(0, 40, 4001))\n"
        "print(hashlib.sha256(places.tobytes()).hexdigest(), 'numba' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "w.yaml")], capture_output=True, text=True, check=True
    )
    import hashlib

    here = Trajectories.of(task.world, START, 5).positions(FINE)
    assert done.stdout.split() == [hashlib.sha256(here.tobytes()).hexdigest(), "False"]


@pytest.mark.parametrize("mover", KINDS[:3] + KINDS[5:], ids=lambda m: f"{type(m).__name__} {getattr(m, 'loop', '')}")
def test_a_later_world_is_where_the_same_world_will_be(mover):
    world = World("w", BOX, POSTS, movers=(mover,))
    now, later = Trajectories.of(world, START), Trajectories.of(world.later(12.5), START)
    np.testing.assert_allclose(later.positions(FINE), now.positions(FINE + 12.5), atol=1e-9)


def test_a_world_without_movers_has_empty_trajectories():
    moving = trajectories()
    assert len(moving) == 0
    assert moving.positions(FINE).shape == (4001, 0, 2)
    assert moving.jumps(FINE).shape == moving.travel(FINE).shape == (4000, 0)


def test_each_motion_has_the_radius_and_the_places_of_its_mover():
    moving = trajectories(*KINDS)
    assert [motion.radius for motion in moving.motions] == moving.radii.tolist()
    assert (moving.motions[0].at(FINE) == moving.positions(FINE)[:, 0]).all()


# Files


@settings(max_examples=25)
@given(st.lists(keyframed() | keyframed(interpolation="catmull-rom"), max_size=3))
def test_keyframes_survive_files_and_json(tmp_path_factory, movers):
    world = World("w", (-100.0, -100.0, 100.0, 100.0), movers=(*movers, *KINDS[5:]))
    if any(math.dist(place, (-90.0, -90.0)) < 1 for place in Trajectories.of(world, (0, 0)).positions(0.0)[0]):
        return
    task = Task(world, (-90.0, -90.0, 0.0), (9.0, 7.0), time_limit=100.0)
    path = tmp_path_factory.mktemp("w") / "task.yaml"
    save_task(task, path)
    assert load_task(path) == task
    assert task_from_dict(json.loads(json.dumps(task_to_dict(task)))) == task


def test_the_example_of_the_format_is_read(tmp_path):
    path = tmp_path / "w.yaml"
    path.write_text(
        "schema: 1\nbounds: [0, 0, 10, 10]\nstart: [1, 1, 0]\ngoal: [9, 9]\nmovers:\n"
        "  - {radius: 0.3, loop: pingpong, keyframes: [[0.0, 5.0, 1.0], [8.0, 5.0, 9.0]]}   # t, x, y\n"
        "  - {radius: 0.3, position: [5, 2], velocity: [1, 0.5], height: 0.4}\n"
        "  - {radius: 0.2, phase: 3, walk: {cell: 0.5, period: 0.8, start: [7, 7], seed: 4}}\n"
    )
    assert load_task(path).world.movers == (
        Keyframed(radius=0.3, keyframes=((0.0, 5.0, 1.0), (8.0, 5.0, 9.0))),
        Cruising(radius=0.3, height=0.4, position=(5.0, 2.0), velocity=(1.0, 0.5)),
        Wandering(radius=0.2, phase=3.0, cell=0.5, period=0.8, start=(7.0, 7.0), seed=4),
    )


#: Movers that cannot be; `test_messages.yml` has what is said of them.
WRONG = (
    lambda: Keyframed(radius=0.0, keyframes=ELL),
    lambda: Keyframed(radius=0.3, keyframes=ELL, loop="round"),
    lambda: Keyframed(radius=0.3, keyframes=((0, 1, 1), (1, math.nan, 1))),
    lambda: Cruising(radius=0.3, position=(1, math.inf), velocity=(1, 1)),
    lambda: Cruising(radius=0.3, position=(1, 1), velocity=(30, 1)),
    lambda: Wandering(radius=0.2, cell=0.0, period=1.0),
    lambda: Wandering(radius=0.2, cell=0.5, period=math.inf),
    lambda: Wandering(radius=0.2, cell=0.5, period=1.0, seed=-1),
    lambda: Wandering(radius=0.2, cell=0.5, period=1.0, start=(1, math.nan)),
)


@pytest.mark.parametrize(("movers", "discs"), [([(1.0, 0.0), (1.0, 2000.0)], 800), ([(0.05, 0.0)] * 1000, 20_000)])
def test_wanderers_may_have_some_steps_behind_them(movers, discs):
    """`test_messages.py` has the errors."""
    walking = tuple(Wandering(radius=0.1, cell=0.5, period=period, phase=phase) for period, phase in movers)
    assert len(World("w", (0.0, 0.0, 10.0, 8.0), (Disc(5.0, 4.0, 0.5),) * discs, None, walking).movers) == len(movers)


def test_worlds_whose_wanderers_hardly_find_a_free_cell_are_refused(monkeypatch):
    """Posts in every cell but a few: each wanderer alone finds one, all of them together take too many draws."""
    posts = tuple(Disc(x + 0.5, y + 0.5, 0.3) for x in range(20) for y in range(20) if (x + 20 * y) % 50)
    one = Wandering(radius=0.2, cell=1.0, period=1.0)
    few, many = (World("w", (0.0, 0.0, 20.0, 20.0), posts, movers=(one,) * n) for n in (2, 100))
    ends = (10.0, 10.0, 0.0), (12.0, 12.0)
    monkeypatch.setattr("antdrive.worlds.motions.MAX_DRAWS", 1500)
    assert len(Trajectories.of(Task(few, *ends).world, ends[0][:2])) == 2
    with pytest.raises(FieldError, match=r"movers\[\d+\].walk.start: missing; .* more than 1500 draws"):
        Task(many, *ends)
    with pytest.raises(InputError, match=r"movers\[\d+\].walk.start: missing"):
        Trajectories.of(many, ends[0][:2])
