"""Detection of forged and broken logs by check: `python -m benchmarks.forgeries [WORD ...]`. Prints Markdown.

A forger changes a genuine log and updates its digest, so the digest detects nothing here. `benchmarks.forged_logs` holds the
forgeries by name; each is applied to all applicable drives of `genuine_drives`. The checks are those of `antdrive verify`,
cheapest first:

- load: the file is not a log, or its arrays and record are invalid
- verify: the log contradicts itself (certificate and consistency)
- files: world or robot differ from the trusted files (`--world`, `--robot`)
- replay: re-execution of the logged commands diverges (`--replay`)
- none: undetected, as documented in docs/explanation/certificate.md
"""

from __future__ import annotations

import collections
import dataclasses
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from antdrive.base.errors import InputError
from antdrive.planners import load_planner
from antdrive.robots import load_robot
from antdrive.sim import Rollout, Scenario, certify, run
from antdrive.sim.driving.replay import replay
from antdrive.sim.log.record import differences
from antdrive.worlds import Cruising, Disc, Keyframed, Task, Wandering, World
from benchmarks.forged_logs import KINDS, LEVELS, Kind, Log
from benchmarks.markdown import command_line, print_table

SMALLEST = ("rows robot",)


def genuine_drives() -> dict[str, Rollout]:
    """Drives of both robots: perfect and noisy, among posts and among movers, with and without a contact."""
    posts = (Disc(2.0, 1.5, 0.3), Disc(3.4, 2.6, 0.25), Disc(3.6, 0.8, 0.35))
    task = Task(World("posts", (0.0, 0.0, 6.0, 3.5), posts), (0.6, 1.4, 0.0), (5.3, 1.9), cell=0.2)
    movers = (
        Cruising(radius=0.2, position=(3.0, 3.0), velocity=(0.1, -0.3)),
        Keyframed(radius=0.2, keyframes=((0.0, 4.5, 0.5), (6.0, 4.5, 3.0))),
        Wandering(radius=0.15, cell=0.5, period=2.0, start=(5.2, 0.6)),
    )
    moving = dataclasses.replace(task, world=dataclasses.replace(task.world, name="moving", movers=movers))
    turtlebot, jackal = load_robot("turtlebot"), load_robot("jackal")
    astar, lite = load_planner("astar"), load_planner("dstar-lite")
    plain = {"task": task, "planner": astar, "planner_name": "astar"}
    among = {"task": moving, "planner": lite, "planner_name": "dstar-lite"}
    scenarios = {
        "turtlebot": Scenario(robot=turtlebot, **plain),  # type: ignore[arg-type]
        "jackal": Scenario(robot=jackal, **plain),  # type: ignore[arg-type]
        "turtlebot, noise": Scenario(robot=turtlebot, noise=1.0, seed=4, **plain),  # type: ignore[arg-type]
        "jackal, noise": Scenario(robot=jackal, noise=1.0, seed=5, **plain),  # type: ignore[arg-type]
        "turtlebot, movers": Scenario(robot=turtlebot, seed=1, **among),  # type: ignore[arg-type]
        "jackal, movers, noise": Scenario(robot=jackal, noise=1.0, seed=2, **among),  # type: ignore[arg-type]
    }
    drives = {name: log for name, s in scenarios.items() if (log := run(s).rollout) is not None}
    for robot in ("turtlebot", "jackal"):
        x, y = drives[robot].pose[len(drives[robot].t) // 2, :2].tolist()
        unseen = (Disc(x, y, 0.1),)
        log = run(dataclasses.replace(scenarios[robot], unseen=unseen)).rollout
        assert log is not None
        drives[f"{robot}, collided"] = log
    return drives


@dataclass(frozen=True)
class Finding:
    """What became of one forged log.

    Attributes:
        kind: what was forged
        drive: the genuine drive
        level: the first level that found it, of LEVELS
        why: what was said first
    """

    kind: str
    drive: str
    level: str
    why: str


def found(path: Path, genuine: Rollout) -> tuple[str, str]:
    """Return the first check that detects a forged log, and its message."""
    try:
        log = Rollout.load(path)
    except InputError as error:
        return "load", str(error).removeprefix(f"{path}: ")
    certificate = certify(log)
    known = set(certify(genuine).problems)
    honest = known and log.outcome is genuine.outcome and len(log.contacts) == len(genuine.contacts)
    problems = [p for p in certificate.problems if not honest or p not in known]
    if problems:
        return "verify", problems[0]
    for problem in differences(log.record, task=genuine.record.task, robot=genuine.record.robot):
        return "files", problem
    for problem in replay(log).problems:
        return "replay", problem
    return "none", ""


def forged(kind: Kind, genuine: Rollout, path: Path) -> bool:
    """Write the forged log; whether the kind makes sense for this drive."""
    log = Log.of(genuine)
    if kind.forge is not None:
        changed = kind.forge(log)
        if changed is None:
            return False
        changed.write(path)
        return True
    assert kind.breaks is not None
    log.write(path)
    path.write_bytes(kind.breaks(path.read_bytes()))
    return True


def all_findings(drives: Mapping[str, Rollout], kinds: Mapping[str, Kind] = KINDS) -> list[Finding]:
    """Every forgery of every drive, checked."""
    results = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "forged.npz"
        for kind in kinds.values():
            for name, genuine in drives.items():
                if kind.breaks is not None and name != "turtlebot":
                    continue
                if forged(kind, genuine, path):
                    results.append(Finding(kind.name, name, *found(path, genuine)))
    return results


def main() -> None:
    words = command_line(__doc__, kinds=([], "only kinds with one of these words")).kinds or [""]
    drives = genuine_drives()
    for name, log in drives.items():
        print(f"- {name}: {log.outcome.key}, {len(log.t)} rows, {certify(log).sentence}")
    chosen = {name: kind for name, kind in KINDS.items() if any(word in name for word in words)}
    results = all_findings(drives, chosen)
    rows = []
    for name in chosen:
        levels = collections.Counter(r.level for r in results if r.kind == name)
        why = next((r.why for r in results if r.kind == name and r.why), "")
        rows.append([name, str(sum(levels.values())), *(str(levels[level] or "") for level in LEVELS), why[:120]])
    total = collections.Counter(r.level for r in results)
    rows.append([f"all {len(chosen)} kinds", str(len(results)), *(str(total[level]) for level in LEVELS), ""])
    print()
    print_table(["forgery", "logs", *LEVELS, "for example"], rows)


if __name__ == "__main__":
    main()
