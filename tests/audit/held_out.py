"""Drives in held-out worlds: `python -m tests.audit.held_out [--drives 10000] [--jobs 2] [--seed S]`.

World, planner, robot, noise and smoothing of drive n follow from n and the seed. Planners alternate over every kind of
world. Each drive is certified, and a second audit (`tests.audit.second_audit`), which shares no code with the certificate,
recomputes the minimum clearance.

Worlds: forests by han2007's rule; thickets of 20 to 60 thinner cylinders; fields by BARN's cellular automaton; halls with
columns and 1 to 10 movers. Results are lines of a JSONL file, from which an interrupted run resumes. `--only N` repeats one
drive and prints its details.

`--margins default` drives with default settings at noise 1 instead, and draws the rest: every planner, kind of smoothing and
robot of the catalogue; without a map in a tenth of the drives of robots with a lidar; worlds without movers, scaled to the
robot. Colonies have few ants and iterations.
"""

from __future__ import annotations

import collections
import functools
import itertools
import json
import math
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from rich.progress import Progress

from antdrive.planners import PLANNERS, capabilities_of, load_planner
from antdrive.robots import list_robots, load_robot
from antdrive.runs.pool import Pool, processes_for
from antdrive.sim import Certificate, Rollout, Scenario, run
from antdrive.sim.settings import SMOOTHINGS
from antdrive.worlds import Disc, Task, World, generate
from antdrive.worlds.files.world_file import save_task
from benchmarks.dynamic import random_task
from benchmarks.markdown import append_line, command_line, read_lines, table
from tests.audit.second_audit import Least, least_clearance

LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # the same values, read ten times faster
ROOT = Path(__file__).parents[2]
RESULTS = Path("out/held_out")
SMALLEST = ("--drives 2 --jobs 1 --margins fixed",)
STREAM = 0x48454C44  # keeps these worlds apart from those of all other seeds
SAME = 2e-4  # the certificate's and the second audit's minimum clearance at the rows agree to this [m]
# The share of worlds of each kind; drives among movers take several times as long.
KINDS = ("forest", "thicket", "barn", "forest", "thicket", "barn", "forest", "thicket", "barn", "hall")
SETTINGS = tuple(itertools.product(("turtlebot", "jackal"), (0.0, 1.0), ("none", "taut", "clearance")))
MARGINS = {"fixed": {0.0: 0.03, 1.0: 0.06}, "auto": {0.0: "auto", 1.0: "auto"}}  # [m], by noise
DEFAULT = "default"  # drives with default settings
MAPLESS = 0.1  # share of their drives without a map, for robots with a lidar
CROSSABLE = 0.363  # radius of a disc that can cross every world before scaling [m]
ROOM = (0.03, 0.15)  # radius that can cross a scaled world, beyond the robot's [m]
QUICK = {"iterations": 12, "ants": 20, "population": 20, "ant_runs": 1, "ant_iterations": 4, "ranks": 10}


def world_of(kind: str, rng: np.random.Generator, radius: float = 0.4) -> Task:
    """Generate a random world of a kind; a disc of a radius [m] can cross forests and thickets."""
    if kind == "hall":
        return random_task(int(rng.integers(1_000_000, 2**31)))[0]
    options = {
        "forest": lambda: {"count": rng.integers(4, 11), "robot_radius": radius},
        "thicket": lambda: {
            "count": rng.integers(20, 61),
            "radius": "0.05,0.4",
            "clearance": "0.7",
            "robot_radius": radius,
        },
        "barn": lambda: {"fill": rng.choice((0.15, 0.20, 0.25)), "rounds": rng.integers(2, 5)},
    }[kind]()
    generator = "barn" if kind == "barn" else "forest"
    return generate(generator, rng, {key: str(value) for key, value in options.items()}, name=kind)


def scaled(task: Task, factor: float) -> Task:
    """Return a task with all lengths multiplied by a factor, without movers."""
    world, (x, y, yaw) = task.world, task.start
    xmin, ymin, xmax, ymax = (factor * end for end in world.bounds)
    discs = tuple(Disc(factor * d.x, factor * d.y, factor * d.radius, d.height) for d in world.obstacles)
    start, goal = (factor * x, factor * y, yaw), (factor * task.goal[0], factor * task.goal[1])
    return Task(World(world.name, (xmin, ymin, xmax, ymax), discs), start, goal, cell=factor * task.cell)


def quick(planner: str) -> dict[str, int]:
    """Return the options for a small colony or population of a planner."""
    made = load_planner(planner)
    return {name: few for name, few in QUICK.items() if getattr(made, name, None)}


def default_case(n: int, seed: int) -> dict[str, Any]:
    """Draw robot, planner and the rest of drive n with default settings."""
    rng = np.random.default_rng([STREAM, seed, n, 1])
    robot, planner = str(rng.choice(list(list_robots()))), str(rng.choice(list(PLANNERS)))
    seeing = load_robot(robot).lidar is not None and not capabilities_of(load_planner(planner)).needs_motions
    return {
        "kind": str(rng.choice(KINDS)),
        "robot": robot,
        "noise": 1.0,
        "smoothing": str(rng.choice(SMOOTHINGS)),
        "planner": planner,
        "map": "none" if rng.random() < MAPLESS and seeing else "given",
    }


def case(n: int) -> dict[str, Any]:
    """Return kind of world, robot, noise, smoothing and planner of drive n."""
    lap, place = divmod(n, len(KINDS))
    robot, noise, smoothing = SETTINGS[lap % len(SETTINGS)]
    names = tuple(PLANNERS)
    planner = names[(lap // len(SETTINGS) + place) % len(names)]
    return {"kind": KINDS[place], "robot": robot, "noise": noise, "smoothing": smoothing, "planner": planner}


def drive(n: int, seed: int, margins: str) -> dict[str, Any]:
    """Drive n: what it was, how it ended, and what both audits say."""
    started = time.perf_counter()
    what = default_case(n, seed) if margins == DEFAULT else case(n)
    found: dict[str, Any] = {"n": n, "seed": seed, "margins": margins, **what}
    try:
        found |= audited(scenario(n, seed, margins))
    except Exception as error:  # a fault of the program is a result, too
        found |= {"outcome": "error", "reason": f"{type(error).__name__}: {error}"}
    return found | {"wall_s": round(time.perf_counter() - started, 3)}


def scenario(n: int, seed: int, margins: str) -> Scenario:
    """Return the scenario of drive n."""
    rng = np.random.default_rng([STREAM, seed, n])
    if margins == DEFAULT:
        return default_scenario(n, seed, rng)
    what = case(n)
    task = world_of(what["kind"], rng)
    return Scenario.of(
        task,
        what["planner"],
        what["robot"],
        noise=what["noise"],
        smoothing=what["smoothing"],
        margin=MARGINS[margins][what["noise"]],
        seed=n,
    )


def default_scenario(n: int, seed: int, rng: np.random.Generator) -> Scenario:
    """Return the scenario of drive n with default settings."""
    what = default_case(n, seed)
    robot = load_robot(what["robot"])
    task = scaled(world_of(what["kind"], rng, CROSSABLE), (robot.radius + float(rng.uniform(*ROOM))) / CROSSABLE)
    settings = {key: what[key] for key in ("noise", "smoothing", "map")}
    return Scenario.of(task, what["planner"], robot, options=quick(what["planner"]), seed=n, **settings)


def audited(s: Scenario) -> dict[str, Any]:
    """Drive a scenario. Return its outcome, certificate and the second audit's findings."""
    done = run(s)
    found: dict[str, Any] = {"outcome": done.outcome.key, "reason": done.reason}
    log, certificate = done.rollout, done.certificate
    if log is None or certificate is None:
        return found
    world, robot = files_of(s)
    least = least_clearance(world, robot["footprint"], log.pose, log.twist, log.record.physics_hz)
    return found | {
        "margin": log.record.margin,
        "digest": log.digest,
        "rows": len(log.t),
        "contacts": len(log.contacts),
        "certified": certificate.certified,
        "problems": list(certificate.problems),
        "min_clearance": certificate.min_clearance,
        "bound": certificate.bound,
        "second_rows": least.rows,
        "second": least.between,
        "second_at": least.t,
        "second_near": least.near,
        "wrong": list(contradictions(log, world, certificate, least)),
    }


def files_of(s: Scenario) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return world file and robot file as plain YAML."""
    folder = RESULTS / "worlds"
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{s.task.world.name}-{s.seed}.yaml"
    save_task(s.task, path)
    world = yaml.load(path.read_text(), LOADER)
    path.unlink()
    return world, yaml.load((ROOT / "robots" / "catalog" / f"{s.robot.name}.yaml").read_text(), LOADER)


def contradictions(log: Rollout, world: dict[str, Any], certificate: Certificate, least: Least) -> Iterator[str]:
    """Return the second audit's objections to a certificate, one sentence each."""
    if abs(least.rows - certificate.min_clearance) > SAME:
        yield (
            f"the minimum clearance at the rows is {certificate.min_clearance:.5f} m in the certificate, "
            f"{least.rows:.5f} m in the second audit"
        )
    if not certificate.certified:
        return
    if not least.between > 0:
        yield f"certified, but the second audit finds an overlap of {-least.between:.5f} m"
    if least.between < certificate.bound:
        yield f"certified to keep {certificate.bound:.5f} m, but the second audit finds {least.between:.5f} m"
    if len(log.contacts):
        yield "certified with contacts"
    x, y, yaw = world["start"]
    if math.dist(log.pose[0, :2], (x, y)) > 0.005 or abs(math.remainder(log.pose[0, 2] - yaw, 2 * math.pi)) > 0.01:
        yield "certified, but the drive does not begin at the start"
    left = math.dist(log.pose[-1, :2], world["goal"])
    if log.outcome.key == "succeeded" and left > world.get("goal_tolerance", 0.25):
        yield f"certified as a success, but it ends {left:.3f} m from the goal"


def has_log(r: dict[str, Any]) -> bool:
    return "contacts" in r


def refused(r: dict[str, Any]) -> bool:
    """Whether nothing was touched, and the log is not certified none the less."""
    return has_log(r) and not r["contacts"] and not r["certified"]


def succeeded(r: dict[str, Any]) -> bool:
    return bool(r["outcome"] == "succeeded" and r.get("certified"))


#: What a table counts, by heading. A drive that did not arrive touched nothing, but ended elsewhere or was too slow.
COUNTS: dict[str, Callable[[dict[str, Any]], bool]] = {
    "driven": has_log,
    "no plan": lambda r: r["outcome"] in ("no_path", "stopped"),
    "certified": succeeded,
    "contacts": lambda r: bool(r.get("contacts")),
    "not arrived": lambda r: has_log(r) and not r["contacts"] and r["outcome"] != "succeeded",
    "refused": refused,
    "wrong": lambda r: bool(r.get("wrong")),
    "errors": lambda r: r["outcome"] in ("error", "invalid_plan"),
}


def counted(keys: Sequence[str], results: Sequence[dict[str, Any]]) -> Iterator[str]:
    """Return a table with one row per combination of some keys of the results, and one for all."""
    groups: dict[tuple[str, ...], list[dict[str, Any]]] = collections.defaultdict(list)
    for r in results:
        groups[tuple(f"{r[key]:g}" if isinstance(r[key], float) else str(r[key]) for key in keys)].append(r)
    rows = [*sorted(groups.items()), (("all", *[""] * (len(keys) - 1)), list(results))]
    lines = []
    for names, some in rows:
        good = [r for r in some if succeeded(r)]
        apart = [r["second"] - r["bound"] for r in good]
        lines.append([
            *names,
            *(str(sum(map(count, some))) for count in COUNTS.values()),
            f"{1000 * min((r['second'] for r in good), default=math.nan):.1f} mm",
            f"{1000 * min(apart, default=math.nan):.2f} mm",
        ])  # fmt: skip
    yield from table([*keys, *COUNTS, "minimum clearance", "least above the bound"], lines)


def failures(results: Sequence[dict[str, Any]]) -> Iterator[str]:
    """Each drive that is not as it should be, with the command that repeats it."""
    for r in results:
        wrong = bool(r.get("wrong")) or refused(r)
        if not wrong and (succeeded(r) or r["outcome"] in ("no_path", "stopped")):
            continue
        why = "; ".join([*r.get("wrong", []), *r.get("problems", []), *([r["reason"]] if r["reason"] else [])])
        what = f"{r['kind']}, {r['robot']}, noise {r['noise']:g}, {r['smoothing']}, {r['planner']}"
        again = f"python -m tests.audit.held_out --seed {r['seed']} --margins {r['margins']} --only {r['n']}"
        yield f"- {what}: {r['outcome']}{f' ({why})' if why else ''}: `{again}`"


def main() -> None:
    given = command_line(
        __doc__,
        drives=(10_000, "how many"),
        first=(0, "number of the first drive"),
        jobs=(2, "processes"),
        seed=(2026, "another seed gives other worlds"),
        margins=("auto", "fixed: 0.03 m, with noise 0.06 m; auto; or default, with default settings at noise 1"),
        only=(int, "number of a drive: drive it again and print all about it"),
        results=(Path, "JSONL file; the default is below out/held_out"),
    )
    if given.only is not None:
        print(json.dumps(drive(given.only, given.seed, given.margins), indent=1))
        return
    path = given.results or RESULTS / f"{given.margins}-{given.seed}.jsonl"
    wanted = range(given.first, given.first + given.drives)
    results = {r["n"]: r for r in read_lines(path)}
    todo = [n for n in wanted if n not in results]
    with Progress() as bar:
        task = bar.add_task("drives", total=len(wanted), completed=len(wanted) - len(todo))
        made = functools.partial(drive, seed=given.seed, margins=given.margins)
        with Pool(processes_for(given.jobs)) as pool:
            for r in pool.results(made, todo, in_order=False):
                results[r["n"]] = r
                append_line(path, r)
                bar.advance(task)
    chosen = [results[n] for n in wanted]
    rows = (
        (("robot", "map", "smoothing"), ("kind",))
        if given.margins == DEFAULT
        else (("kind", "robot", "noise", "smoothing"),)
    )
    for keys in (*rows, ("planner",)):
        print("\n".join(counted(keys, chosen)))
    print("Drives that are not certified successes:\n")
    print("\n".join(failures(chosen)) or "none")


if __name__ == "__main__":
    main()
