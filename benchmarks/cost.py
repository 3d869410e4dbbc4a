"""Cost of a certified drive and of a film frame, in this and another checkout: `python -m benchmarks.cost`.

`--against PATH` runs the same drives in another checkout, in a separate process, alternating world by world. The table shows
medians and the median ratio within a pair; every pair of drives must agree bit for bit. Drives are timed in processor time,
films in wall-clock time and in processor time without the encoder. Ratios compare processor times. The limit of a drive is
bare physics: its steps and commands alone, after each drive.

- first: a world that is new to the process, read from its YAML file
- again: the same file with the next seed, in the same process
- mapless: the same worlds without a map, after each drive with one, by planner (`--mapless 0`: none)
- film: ten seconds among movers, from a fixed camera, rendered and encoded

The worlds are BARN's, written to a temporary folder as YAML, or all YAML files of a folder (`--worlds`).
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

SMALLEST = ("--count 1 --seconds 0.1 --rounds 1 --mapless 1",)
HERE = Path(__file__).parent.parent
SIZES = ((640, 480), (1280, 720))
MOVERS = (0, 6, 24)
PLANNER, ROBOT = "astar", "jackal"
MAPLESS = (PLANNER, "dstar-lite")


def write_barn(source: Path, folder: Path, count: int) -> None:
    """Write BARN's first worlds, in the order of their names, to a folder as world files."""
    from antdrive.worlds import save_task
    from benchmarks.drives import barn_tasks

    for name, task in sorted(barn_tasks(source).items())[:count]:
        save_task(task, folder / f"{name}.yaml")


def drive(path: str, seed: int, planner: str = PLANNER, map: str = "given") -> dict[str, Any]:
    """Drive a world file. Return the costs [s], the digest of the drive and its number of replans."""
    from antdrive.sim import Scenario, run

    started = time.process_time()
    done = run(Scenario.of(path, planner, ROBOT, seed=seed, map=map))
    cost = time.process_time() - started
    assert done.rollout is not None
    answer = {"cost": cost, "certified": done.succeeded, "digest": done.rollout.drive_digest}
    answer["replans"], answer["simulated"] = len(done.rollout.record.replans), float(done.rollout.t[-1])
    return {**answer, "bare": bare_physics(done.rollout)}


def bare_physics(log: Any) -> float:
    """Return the processor time of a drive's physics steps alone, with its commands [s]."""
    from antdrive.sim.physics.bullet import bullet
    from antdrive.sim.physics.engine import Engine

    p, record = bullet(), log.record
    per_period = record.physics_hz // record.control_hz
    with Engine(record.world, record.robot, physics_hz=record.physics_hz) as engine:
        engine.place(record.task.start)
        started = time.process_time()
        for command in log.command[1::per_period].tolist():
            engine.command(*command)
            for _ in range(per_period):
                p.stepSimulation(engine._client)
        return time.process_time() - started


def film_rate(movers: int, size: tuple[int, int], seconds: float) -> dict[str, Any]:
    """Film a drive through a hall with movers. Return the frames per second."""
    from antdrive.views.film.video import film
    from benchmarks.film import cut, hall_drive

    part = cut(hall_drive(movers), seconds)
    with tempfile.TemporaryDirectory() as folder:
        started = time.process_time()
        info = film(part, Path(folder) / "a.mp4", size=size, jobs=1)
        cost = time.process_time() - started
    return {"rate": info.frames / info.wall_s, "cost": cost / info.frames}


def serve() -> None:
    """Answer requests, one line of JSON each, until the input ends."""
    for line in sys.stdin:
        kind, *rest = json.loads(line)
        answer = drive(*rest) if kind == "drive" else film_rate(rest[0], tuple(rest[1]), rest[2])
        print(json.dumps(answer), flush=True)


class Checkout:
    """A process that serves requests by this script and antdrive of a checkout."""

    def __init__(self, root: Path, python: str) -> None:
        path = f"{root / 'src'}{os.pathsep}{root}"
        environment = {**os.environ, "PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1"}
        command = [python, str(HERE / "benchmarks" / "cost.py"), "--serve"]
        self._process = subprocess.Popen(
            command, cwd=root, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def ask(self, *request: Any) -> dict[str, Any]:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        print(json.dumps(request), file=self._process.stdin, flush=True)
        line = self._process.stdout.readline()
        if not line:
            raise SystemExit(f"process of a checkout exited with code {self._process.wait()}")
        answer: dict[str, Any] = json.loads(line)
        return answer

    def close(self) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()


def drives_table(checkouts: dict[str, Checkout], worlds: list[Path]) -> Iterator[str]:
    """Yield the costs of first and further drives, alternating checkouts world by world."""
    for checkout in checkouts.values():  # loads kernels, with a world outside the table
        checkout.ask("drive", "slalom", 0)
    costs: dict[tuple[str, str], list[float]] = {}
    bare: dict[str, list[float]] = {}
    certified = 0
    for k, world in enumerate(worlds):
        for kind, seed in (("first", 0), ("again", 1)):
            # The order alternates, so that load from other programs affects both alike.
            order = list(checkouts) if k % 2 else list(checkouts)[::-1]
            found = {name: checkouts[name].ask("drive", str(world), seed) for name in order}
            assert len({answer["digest"] for answer in found.values()}) == 1, f"{world}: the drives differ"
            certified += all(answer["certified"] for answer in found.values())
            bare.setdefault(kind, []).append(found["here"]["bare"])
            for name, answer in found.items():
                costs.setdefault((kind, name), []).append(answer["cost"])
    yield f"{len(worlds)} worlds, {PLANNER} with {ROBOT}; {certified} of {2 * len(worlds)} drives certified; all pairs alike"
    columns = " | ".join(f"{name} [ms] | {name} [drives/s] | {name} / bare" for name in checkouts)
    yield f"| drive | {columns} | bare [drives/s] | ratio |"
    yield "|---|" + "---|" * (3 * len(checkouts) + 2)
    reference = list(checkouts)[-1]
    for kind in ("first", "again"):
        cells = [
            f"{1e3 * statistics.median(costs[kind, name]):.0f} | {len(worlds) / sum(costs[kind, name]):.1f} | "
            f"{sum(costs[kind, name]) / sum(bare[kind]):.2f}"
            for name in checkouts
        ]
        ratio = statistics.median(b / a for a, b in zip(costs[kind, "here"], costs[kind, reference], strict=True))
        yield f"| {kind} | {' | '.join(cells)} | {len(worlds) / sum(bare[kind]):.1f} | {ratio:.2f} |"


def mapless_table(checkouts: dict[str, Checkout], worlds: list[Path]) -> Iterator[str]:
    """Yield the costs of drives without a map beside those with one, in turn."""
    yield f"\n{len(worlds)} worlds with and without a map, {ROBOT}"
    yield "| planner | checkout | map [ms] | mapless [ms] | mapless / map | per simulated second | certified | replans |"
    yield "|---|---|---|---|---|---|---|---|"
    for planner in MAPLESS:
        found: dict[tuple[str, str], list[dict[str, Any]]] = {}
        for k, world in enumerate((worlds[0], *worlds)):  # the first drives load kernels
            for map in ("given", "none"):
                for name in list(checkouts) if k % 2 else list(checkouts)[::-1]:
                    answer = checkouts[name].ask("drive", str(world), 0, planner, map)
                    if k:
                        found.setdefault((name, map), []).append(answer)
        for name in checkouts:
            mapped, mapless = found[name, "given"], found[name, "none"]
            costs = [sum(answer["cost"] for answer in answers) for answers in (mapped, mapless)]
            times = [sum(answer["simulated"] for answer in answers) for answers in (mapped, mapless)]
            ratio, certified = costs[1] / costs[0], sum(answer["certified"] for answer in mapless)
            each = [1e3 * cost / len(worlds) for cost in costs]
            yield (
                f"| {planner} | {name} | {each[0]:.0f} | {each[1]:.0f} | {ratio:.2f} | {ratio * times[0] / times[1]:.2f} | "
                f"{certified} of {len(worlds)} | {sum(answer['replans'] for answer in mapless)} |"
            )
        pairs = zip(*(found[name, "none"] for name in checkouts), strict=True)
        assert all(len({answer["digest"] for answer in pair}) == 1 for pair in pairs), f"{planner}: the drives differ"


def films_table(checkouts: dict[str, Checkout], seconds: float, rounds: int) -> Iterator[str]:
    """Yield frames per second among movers, and the processor time of a frame without encoding."""
    yield f"\n{seconds:g} s of film, camera oblique, rendered and encoded; median of {rounds}"
    yield "| movers | size | " + " | ".join(f"{name} [frames/s] | {name} [ms]" for name in checkouts) + " | ratio |"
    yield "|---|---|" + "---|" * (2 * len(checkouts) + 1)
    reference = list(checkouts)[-1]
    for checkout in checkouts.values():
        checkout.ask("film", 1, (160, 160), 0.1)
    for movers in MOVERS:
        for size in SIZES:
            found: dict[str, list[dict[str, Any]]] = {name: [] for name in checkouts}
            for _ in range(rounds):
                for name, checkout in checkouts.items():
                    found[name].append(checkout.ask("film", movers, size, seconds))
            cells = [
                f"{statistics.median(a['rate'] for a in answers):.0f} | {1e3 * statistics.median(a['cost'] for a in answers):.1f}"
                for answers in found.values()
            ]
            pairs = zip(found["here"], found[reference], strict=True)
            ratio = statistics.median(b["cost"] / a["cost"] for a, b in pairs)
            yield f"| {movers} | {size[0]}x{size[1]} | {' | '.join(cells)} | {ratio:.1f} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--against", type=Path, help="root of another checkout of antdrive")
    parser.add_argument("--worlds", type=Path, help="folder of world files; default: BARN's worlds")
    parser.add_argument("--barn", type=Path, help="folder or archive of BARN's world_*.world files")
    parser.add_argument("--count", type=int, default=50, help="number of worlds; 0: no drives")
    parser.add_argument("--mapless", type=int, default=50, help="number of worlds with and without a map; 0: none")
    parser.add_argument("--seconds", type=float, default=10.0, help="length of each film; 0: no films [s]")
    parser.add_argument("--rounds", type=int, default=3, help="films of each kind")
    parser.add_argument("--python", default=sys.executable, help="interpreter of both checkouts")
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        serve()
        return
    from tools.shared_data import BARN  # missing in older checkouts, which only serve

    barn = options.barn or BARN
    with contextlib.ExitStack() as stack:
        folder = options.worlds or Path(stack.enter_context(tempfile.TemporaryDirectory()))
        if options.worlds is None:
            write_barn(barn, folder, options.count)
        worlds = sorted(folder.glob("*.yaml"))[: options.count]
        if options.count and not worlds:
            raise SystemExit(f"no worlds in {options.worlds or barn}; give --worlds or --barn")
        roots = {"here": HERE} | ({"there": options.against.resolve()} if options.against else {})
        checkouts = {}
        for name, root in roots.items():
            checkouts[name] = Checkout(root, options.python)
            stack.callback(checkouts[name].close)
        if options.count:
            for line in drives_table(checkouts, worlds):
                print(line, flush=True)
        if options.mapless and worlds:
            for line in mapless_table(checkouts, worlds[: options.mapless]):
                print(line, flush=True)
        if options.seconds:
            for line in films_table(checkouts, options.seconds, options.rounds):
                print(line, flush=True)


if __name__ == "__main__":
    main()
