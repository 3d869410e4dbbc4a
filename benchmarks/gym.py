"""Robot-steps a second of the kinematic batch beside ir-sim: `python -m benchmarks.gym`.

Robots with 64 beams drive among 64 discs, at ten actions a second; both simulators step in turn within one run, and the median
over the rounds counts. Ours includes limits, exact contact, rewards, infos and new episodes; at noise 1 slip, delay and pose
fixes, too. ir-sim's robots share one world, in which no lidar sees another robot and no collision is checked. Times are
processor times of one core. `--memory` prints the memory of 4,096 robots. `--alike N` drives N episodes without noise on both
plants and compares where the robots are and how they end. Prints Markdown.
"""

from __future__ import annotations

import contextlib
import os
import resource
import statistics
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from antdrive.worlds import Disc, Task, World
from benchmarks.markdown import command_line, missing, print_table

try:
    from gymnasium.vector import AutoresetMode

    from antdrive.gym.env import NavigationEnv
    from antdrive.gym.vector import NavigationVectorEnv
except ImportError as error:
    missing(f"{error}: install the extra `gym`")

SMALLEST = ("--robots 4 --steps 2 --rounds 1",)
SIDE, DISCS, BEAMS, HELD = 20.0, 64, 64, 10
Step = Callable[[Any], Any]


def task_among() -> Task:
    """A square with discs, crossed from the middle to a corner."""
    rng, discs = np.random.default_rng(0), list[Disc]()
    while len(discs) < DISCS:
        x, y = rng.uniform(0.5, SIDE - 0.5, 2).tolist()
        if np.hypot(x - SIDE / 2, y - SIDE / 2) > 1.5:
            discs.append(Disc(x, y, float(rng.uniform(0.1, 0.4))))
    return Task(World("among", (0.0, 0.0, SIDE, SIDE), tuple(discs)), (SIDE / 2, SIDE / 2, 0.0), (SIDE - 1, SIDE - 1))


def batch(robots: int, noise: float) -> Step:
    env = NavigationVectorEnv(
        robots, "world", source=task_among(), noise=noise, beams=BEAMS, autoreset_mode=AutoresetMode.SAME_STEP
    )
    env.reset(seed=0)
    return env.step


def alone(plant: str) -> Step:
    env = NavigationEnv("world", source=task_among(), beams=BEAMS, plant=plant)
    env.reset(seed=0)

    def step(actions: Any) -> None:
        *_, over, late, _ = env.step(actions[0])
        if over or late:
            env.reset()

    return step


def ir_sim(robots: int) -> Step | None:
    """Its robots, or None where it is not installed; it prints on import."""
    try:
        with contextlib.redirect_stdout(sys.stderr):
            import irsim
            import yaml
    except ImportError:
        return None
    task, rng = task_among(), np.random.default_rng(1)
    lidar = {"name": "lidar2d", "range_min": 0.1, "range_max": 10.0, "angle_range": 4.71, "number": BEAMS}
    places = [[*rng.uniform(1.0, SIDE - 1.0, 2).tolist(), 0.0] for _ in range(robots)]
    one = {"kinematics": {"name": "diff"}, "vel_max": [2.0, 4.0], "vel_min": [-2.0, -4.0], "sensors": [lidar]}
    one |= {"shape": {"name": "rectangle", "length": 0.508, "width": 0.43}, "unobstructed": True}
    discs = [{"shape": {"name": "circle", "radius": d.radius}, "state": [d.x, d.y, 0.0]} for d in task.world.obstacles]
    world = {
        "world": {"height": SIDE, "width": SIDE, "step_time": 0.1, "collision_mode": "unobstructed"},
        "robot": [{**one, "state": place, "goal": [SIDE - 1, SIDE - 1, 0.0]} for place in places],
        "obstacle": discs,
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "among.yaml"
        path.write_text(yaml.safe_dump(world))
        env = irsim.make(str(path), headless=True, log_level="ERROR")

    def step(actions: Any) -> None:
        commands = [np.array([[2.0 * v], [4.0 * w]]) for v, w in actions.tolist()]
        env.step(commands, action_id=list(range(robots)))

    return step


def rate(step: Step, robots: int, steps: int) -> float:
    """Robot-steps in a second of processor time."""
    rng = np.random.default_rng(2)
    actions = rng.uniform(-1, 1, (-(-steps // HELD), robots, 2)).repeat(HELD, axis=0)[:steps]
    started = time.process_time()
    for action in actions:
        step(action)
    return robots * steps / (time.process_time() - started)


def print_memory(robots: int = 4096) -> None:
    batch(1, 1.0)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    batch(robots, 1.0)(np.zeros((robots, 2)))
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    print(f"{robots} robots: {grown:.0f} MB")


def steered(observation: Any) -> Any:
    """An action towards the goal, slower and to the freer side near obstacles."""
    scan, (_, cos, sin) = observation["scan"], observation["goal"]
    ahead, middle = 10.0 * scan[BEAMS * 3 // 8 : BEAMS * 5 // 8].min(), BEAMS // 2
    aside = np.sign(scan[middle:].mean() - scan[:middle].mean()) if ahead < 1.5 else 0.0
    return np.array([np.clip(ahead / 4 - 0.1, 0.02, 0.5), np.clip(np.arctan2(sin, cos) + aside, -1, 1)])


def print_alike(count: int) -> None:
    """How far the kinematic plant is from physics when both take the same actions, until one of them ends."""
    apart, same, outcomes = list[float](), 0, Counter[str]()
    plants = [NavigationEnv("forest", plant=plant, beams=BEAMS) for plant in ("bullet", "kinematic")]
    for seed in range(count):
        (observation, _), _ = (plant.reset(seed=seed) for plant in plants)
        ends, worst = ["", ""], 0.0
        while not any(ends):
            action = steered(observation)
            steps = [plant.step(action) for plant in plants]
            observation, poses = steps[0][0], [plant.pose for plant in plants]
            worst = max(worst, float(np.hypot(*(poses[0] - poses[1])[:2])))
            ends = [step[4]["outcome"] for step in steps]
        while not all(ends):  # one plant ended a step or two before the other
            late = ends.index("")
            ends[late] = plants[late].step(steered(observation))[4]["outcome"] or ends[late]
        apart.append(worst)
        same += ends[0] == ends[1]
        outcomes[ends[0]] += 1
    shares = [f"{1e3 * np.quantile(apart, share):.1f}" for share in (0.5, 0.95, 1.0)]
    print_table(
        "episodes | same outcome | largest distance: median | 95 % | most [mm] | outcomes in physics",
        [(str(count), f"{100 * same / count:.1f} %", *shares, str(dict(outcomes)))],
    )


def main() -> None:
    o = command_line(
        __doc__,
        robots=(1024, "robots of a batch"),
        steps=(100, "actions in a round"),
        rounds=(5, "rounds"),
        memory=(False, "print the memory of 4,096 robots"),
        alike=(0, "episodes on both plants"),
    )
    if o.alike:
        print_alike(o.alike)
        return
    if o.memory:
        print_memory()
        return
    few = min(o.robots, 64)
    steppers = {
        f"kinematic batch of {o.robots}": (batch(o.robots, 0.0), o.robots, o.steps),
        f"kinematic batch of {o.robots}, noise 1": (batch(o.robots, 1.0), o.robots, o.steps),
        "one kinematic environment": (alone("kinematic"), 1, 10 * o.steps),
        "one environment in physics": (alone("bullet"), 1, 3 * o.steps),
    }
    other = ir_sim(few)
    if other is not None:
        steppers[f"ir-sim, {few} robots"] = other, few, max(o.steps // 10, 1)
    found: dict[str, list[float]] = {name: [] for name in steppers}
    for step, robots, _ in steppers.values():
        rate(step, robots, 2)
    for _ in range(o.rounds):
        for name, (step, robots, steps) in steppers.items():
            found[name].append(rate(step, robots, steps))
    rows = [
        (name, f"{statistics.median(rates):,.0f}", f"{min(rates):,.0f} to {max(rates):,.0f}")
        for name, rates in found.items()
    ]
    print_table("simulator | robot-steps/s of one core, median | range", rows)
    print(f"{BEAMS} beams, {DISCS} discs, load {os.getloadavg()[0]:.1f}")
    if other is None:
        print("ir-sim is not installed: `pip install ir-sim` brings what is measured against", file=sys.stderr)


if __name__ == "__main__":
    main()
