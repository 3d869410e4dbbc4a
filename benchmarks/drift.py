"""Drift of drives between compiler targets and versions: `python -m benchmarks.drift`.

Other processes drive the same scenarios: with machine code for a generic CPU (`NUMBA_CPU_NAME=generic`), without compilation
(`NUMBA_DISABLE_JIT=1`, some scenarios only), and with given interpreters, which may have other versions of Python and numpy
and another distribution of PyBullet. The printed table is the source of the default tolerances in `antdrive.sim.log.metrics`.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.markdown import command_line, print_table

SMALLEST = ("--size tiny --variants 1",)
HZ = 10
WALL_CLOCK = ("plan_s", "drive_wall_s")


def scenarios(size: str) -> Iterator[tuple[str, str, Any]]:
    """Yield kind, name and scenario of each drive; smaller sizes have the first of each kind, `tiny` two in one forest."""
    from antdrive.sim import Scenario
    from antdrive.worlds import generate

    for kind in ("forest",) if size == "tiny" else ("forest", "barn"):
        for seed in range(6 if size == "full" else 1):
            task = generate(kind, np.random.default_rng(seed), {}, name=f"{kind}-{seed}", note="")
            for robot in ("turtlebot",) if size == "tiny" else ("turtlebot", "jackal"):
                for noise in (0.0, 1.0):
                    name = f"{kind}-{seed} {robot} noise {noise:g}"
                    what = "standing, noise 1" if noise else "standing, noise 0"
                    yield what, name, Scenario.of(task, "astar", robot, noise=noise, seed=seed)
    if size == "tiny":
        return
    planners = ("aco-han", "ants", "mmas", "pfaco", "ga-han", "hybrid", "tangent")
    for planner in planners if size == "full" else planners[:1]:
        for seed in range(2):
            yield "standing, ants and genes", f"forest {planner} {seed}", Scenario.of("forest", planner, seed=seed)
    worlds = (
        ("plaza-moving", "dstar-lite"), ("plaza-moving", "astar"), ("plaza-moving", "sipp"), ("hasan-1a-moving", "dstar-lite"),
        ("hasan-3c-moving", "dstar-lite"), ("hasan-5e-moving", "ants"),
    )  # fmt: skip
    for world, planner in worlds if size == "full" else worlds[:1]:
        for seed in range(3 if size == "full" else 2):
            yield "among movers", f"{world} {planner} {seed}", Scenario.of(world, planner, seed=seed)
    for world in ("forest", "slalom", "plaza-moving") if size == "full" else ("slalom",):
        for robot in ("turtlebot", "jackal"):
            for seed in range(2 if size == "full" else 1):
                s = Scenario.of(world, "dstar-lite", robot, map="none", noise=1.0, seed=seed)
                yield "without a map, noise 1", f"{world} {robot} {seed}", s


def drive_all(size: str) -> dict[str, Any]:
    """Return each drive's results by name, as plain values."""
    from antdrive.sim import measure, run

    found = {}
    for kind, name, scenario in scenarios(size):
        done = run(scenario)
        if done.rollout is None:
            found[name] = {"kind": kind, "outcome": done.outcome.key}
            continue
        log = done.rollout
        moments = np.arange(0.0, float(log.t[-1]), 1 / HZ)
        line = [
            [float(v) for v in np.interp(moments, log.t, log.pose[:, axis])] + [float(log.pose[-1, axis])]
            for axis in (0, 1)
        ]
        metrics = {key: value for key, value in measure(log).items() if key not in WALL_CLOCK}
        found[name] = {
            "kind": kind, "outcome": done.outcome.key, "certified": done.succeeded, "metrics": metrics, "line": line,
            "digest": log.drive_digest,
        }  # fmt: skip
    return found


def other(python: str, size: str, extra: Mapping[str, str]) -> dict[str, Any]:
    """Return the versions and drives of another process."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "drives.json"
        words = [python, "-m", "benchmarks.drift", "--write", str(path), "--size", size]
        subprocess.run(words, env={**os.environ, **extra}, check=True)
        content = json.loads(path.read_text())
        assert isinstance(content, dict)
        return content


def words(versions: Mapping[str, str]) -> str:
    """Return the versions that a drive depends on, in words."""
    return ", ".join(f"{name} {versions[name]}" for name in ("python", "numpy", "numba", "pybullet"))


def rows(name: str, ours: Mapping[str, Any], theirs: Mapping[str, Any]) -> Iterator[list[str]]:
    """Return one row per kind of drive."""
    kinds = dict.fromkeys(drive["kind"] for drive in theirs.values())
    for kind in kinds:
        pairs = [(ours[key], drive) for key, drive in theirs.items() if drive["kind"] == kind]
        driven = [(a, b) for a, b in pairs if "line" in a and "line" in b]
        same = sum(a.get("digest") == b.get("digest") and a["outcome"] == b["outcome"] for a, b in pairs)
        verdicts = sum((a["outcome"], a.get("certified")) != (b["outcome"], b.get("certified")) for a, b in pairs)
        changes = {key: max(change(key, a, b) for a, b in driven) for key in driven[0][0]["metrics"]}
        yield [
            name, kind, f"{same} of {len(pairs)}", str(verdicts), f"{max(apart(a, b) for a, b in driven):.2g}",
            *(f"{changes[key]:.2g}" for key in ("min_clearance_m", "driven_length_m", "duration_s", "tracking_error_max_m")),
            ", ".join(f"{key} {value:.2g}" for key, value in changes.items() if value > 1e-6) or "none",
        ]  # fmt: skip


def change(key: str, a: Mapping[str, Any], b: Mapping[str, Any]) -> float:
    """Return the difference of a metric; 0 if both are NaN."""
    difference = abs(a["metrics"][key] - b["metrics"][key])
    return 0.0 if np.isnan(difference) else float(difference)


def apart(a: Mapping[str, Any], b: Mapping[str, Any]) -> float:
    """Return the largest distance between two drives at equal times [m]; a robot stays at its end."""
    first, second = (np.array(drive["line"]) for drive in (a, b))
    most = max(first.shape[1], second.shape[1])
    first, second = (np.pad(line, ((0, 0), (0, most - line.shape[1])), mode="edge") for line in (first, second))
    return float(np.hypot(*(first - second)).max())


def main() -> None:
    arguments = command_line(
        __doc__,
        python=([], "paths of other interpreters"),
        write=(Path, "drive in this process and write what came out as JSON"),
        size=("full", "how many scenarios: tiny, small or full"),
        variants=(3, "how many of: again, generic CPU, not compiled"),
    )
    from antdrive.base.version import versions

    ours = drive_all(arguments.size)
    if arguments.write:
        arguments.write.write_text(json.dumps({"versions": versions(), "drives": ours}))
        return
    variants: list[tuple[str, str, str, dict[str, str]]] = [
        ("again", sys.executable, arguments.size, {}),
        ("generic CPU", sys.executable, arguments.size, {"NUMBA_CPU_NAME": "generic"}),
        ("not compiled", sys.executable, "tiny", {"NUMBA_DISABLE_JIT": "1"}),
    ][: arguments.variants]
    variants += [("", path, arguments.size, {}) for path in arguments.python]
    heads = "drives | kind | bit-identical | other verdict | line [m] | min_clearance_m | driven_length_m | duration_s"
    found: list[list[str]] = []
    for name, python, size, extra in variants:
        print(f"driving: {name or python}", file=sys.stderr)
        answer = other(python, size, extra)
        found += rows(name or words(answer["versions"]), ours, answer["drives"])
        print(*found[-1], sep=" | ", file=sys.stderr)
    print(f"Compared with {words(versions())}.\n")
    print_table(f"{heads} | tracking_error_max_m | metrics that changed by more than 1e-6", found)


if __name__ == "__main__":
    main()
