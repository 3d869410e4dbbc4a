"""Detection of forged and broken logs by check: `python -m tests.audit.forgeries [WORD ...] [--count N] [--seed S]`.

A forger changes a genuine log and updates its digest, so the digest detects nothing here. `tests.audit.forged_fields` holds an
entry for every array and every key of the record, `tests.audit.forged_logs` forgeries written by hand. Draws are forgeries by
random amounts in random drives of `genuine_drives`. The checks are those of `antdrive verify`, cheapest first:

- load: the file is not a log, or its arrays and record are invalid
- verify: the log contradicts itself (certificate and consistency)
- files: world or robot differ from the trusted files, or the optima from the world (`--world`, `--robot`)
- replay: the recorded scenario leads to another log (`--replay`)
- none: undetected: a claim, or an input with which the same drive follows

A forgery that passes the level that its declaration names is printed with the command that repeats it.
"""

from __future__ import annotations

import collections
import dataclasses
import itertools
import json
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from antdrive.base.errors import InputError
from antdrive.planners import PlannerError, load_planner
from antdrive.robots import Footprint, load_robot
from antdrive.runs.margins.choice import with_chosen_margin
from antdrive.sim import Perception, Rollout, Scenario, certify, run
from antdrive.sim.log.consistency import wrong_optima
from antdrive.sim.log.record import PROOFS, DriveRecord, Evidence, differences, plain_value
from antdrive.sim.rerun import mismatches, rerun
from antdrive.worlds import Cruising, Disc, Keyframed, Task, Wandering, World
from benchmarks.markdown import command_line, print_table
from tests.audit.forged_fields import ENTRIES, POOL, forgery_of, level_of
from tests.audit.forged_logs import KINDS, LEVELS, Kind, Log
from tests.audit.kinds import DriveKind, crossed, scenario

CRASHED = "crash"  # in place of a level: the check raised an exception
BY_HAND = 8  # drives of `genuine_drives`
GENERATED = 0.6  # share of draws from the generated entries alone
SMALLEST = ("rows noise --count 3 --few",)


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


def more_drives(kinds: Sequence[DriveKind], seed: int = 0) -> dict[str, Rollout]:
    """Random drives of some kinds of `tests.audit.kinds`, each the first that has a log."""
    found = {}
    for number, kind in enumerate(kinds):
        logs = (
            run(scenario(kind, np.random.default_rng([seed, number, again]))).rollout for again in itertools.count()
        )
        log = next(log for log in logs if log is not None)
        found[f"{number}: {', '.join(map(str, kind.values()))}, {log.record.robot.name}, {log.record.planner.name}"] = (
            log
        )
    return found


def special_drives() -> dict[str, Rollout]:
    """Drives with what no setting asks for: a chosen margin, a polygon off the axle, a range of sight, a closed corridor."""
    posts = (Disc(2.0, 1.5, 0.3), Disc(3.4, 2.6, 0.25), Disc(3.6, 0.8, 0.35))
    task = Task(World("posts", (0.0, 0.0, 6.0, 3.5), posts), (0.6, 1.4, 0.0), (5.3, 1.9), cell=0.1)
    walker = Keyframed(radius=0.2, keyframes=((0.0, 4.5, 0.5), (6.0, 4.5, 3.0)))
    moving = dataclasses.replace(task, world=dataclasses.replace(task.world, name="moving", movers=(walker,)))
    corners = ((0.25, 0.12), (-0.1, 0.15), (-0.12, -0.15), (0.2, -0.14))
    off_axle = dataclasses.replace(
        load_robot("turtlebot"), name="off-axle", footprint=Footprint(0.0, 0.0, 0.0, corners)
    )
    guard = Keyframed(radius=0.35, keyframes=((0.0, 3.0, 0.6), (1.0, 3.0, 0.6)))
    corridor = Task(World("corridor", (0.0, 0.0, 6.0, 1.2), movers=(guard,)), (0.8, 0.6, 0.0), (5.3, 0.6), cell=0.1)
    scenarios = {
        "chosen margin": with_chosen_margin(Scenario.of(task, "astar", noise=1.0)),
        "polygon off the axle": Scenario.of(task, "astar", off_axle, noise=1.0),
        "positions within 2 m": Scenario.of(moving, "dstar-lite", perception=Perception(kind="positions", range=2.0)),
        "blocked": Scenario.of(corridor, "astar"),
    }
    return {name: log for name, s in scenarios.items() if (log := run(s).rollout) is not None}


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


@dataclass
class Judge:
    """The levels of `antdrive verify`, with caches of what many forgeries share.

    Attributes:
        known: problems of genuine logs, by digest
        reruns: reruns, or why there is none, by the inputs of the record
        optima: what a comparison of optima found
    """

    known: dict[str, set[str]] = field(default_factory=dict)
    reruns: dict[str, Rollout | str] = field(default_factory=dict)
    optima: dict[str, str] = field(default_factory=dict)

    def found(self, path: Path, genuine: Rollout) -> tuple[str, str]:
        """Return the first check that detects a forged log, and its message."""
        try:
            log = Rollout.load(path)
        except InputError as error:
            return "load", str(error).removeprefix(f"{path}: ")
        seal = genuine.digest
        if seal not in self.known:
            self.known[seal] = set(certify(genuine).problems)
        known = self.known[seal]
        honest = known and log.outcome is genuine.outcome and len(log.contacts) == len(genuine.contacts)
        problems = [p for p in certify(log).problems if not honest or p not in known]
        if problems:
            return "verify", problems[0]
        for problem in differences(log.record, task=genuine.record.task, robot=genuine.record.robot):
            return "files", problem
        plan = log.record.plan
        key = f"{seal} {log.record.cell} {log.record.inflate} {plan.grid_optimum_m} {plan.euclidean_optimum_m}"
        if key not in self.optima:
            self.optima[key] = next(iter(wrong_optima(log.record)), "")
        if self.optima[key]:
            return "files", self.optima[key]
        problem = self.replayed(log)
        return ("replay", problem) if problem else ("none", "")

    def replayed(self, log: Rollout) -> str:
        """Return what the replay says first; empty if it reproduces the log."""
        key = inputs_of(log.record) + str(len(log.t))
        if key not in self.reruns:
            try:
                self.reruns[key] = rerun(log)
            except (PlannerError, ValueError) as error:
                self.reruns[key] = str(error) or type(error).__name__
        again = self.reruns[key]
        if isinstance(again, str):
            return f"replay: {again}"
        again = dataclasses.replace(again, record=dataclasses.replace(again.record, digest=log.record.digest))
        for one in mismatches(log, again):
            if not one.rounded:
                return f"replay: {one.name}{one.text}"
        return ""


def inputs_of(record: DriveRecord) -> str:
    """Return what a rerun depends on, as JSON: the record without what it computes and without claims."""
    values = plain_value(record)
    for key, proof in PROOFS.items():
        name, _, rest = key.partition(".")
        if proof in (Evidence.INPUT, Evidence.ROBOT) or name in ("task", "robot"):
            continue
        if rest and not name.endswith("[]"):
            (values.get(name) or {}).pop(rest, None)
        else:
            values.pop(name.removesuffix("[]"), None)
    return json.dumps(values, sort_keys=True)


def found(path: Path, genuine: Rollout) -> tuple[str, str]:
    """Return the first check that detects a forged log, and its message."""
    return JUDGE.found(path, genuine)


JUDGE = Judge()


def forged(kind: Kind, genuine: Rollout, path: Path) -> bool:
    """Write the forged log; whether the kind makes sense for this drive."""
    log = Log.of(genuine) if kind.breaks is not None else forgery_of(kind.name, genuine)
    if log is None:
        return False
    log.write(path)
    if kind.breaks is not None:
        path.write_bytes(kind.breaks(path.read_bytes()))
    return True


def drawn(
    drives: Mapping[str, Rollout], names: list[str], rng: np.random.Generator, path: Path
) -> tuple[str, str] | None:
    """Write a forgery by a random amount; return what and whose it is, or None if it makes no sense for the drawn drive."""
    generated = [name for name in names if name in ENTRIES]
    some = generated if generated and (len(generated) == len(names) or rng.random() < GENERATED) else names
    name = some[rng.integers(len(some))]
    whose = list(drives)[
        : None if name in ENTRIES else BY_HAND
    ]  # forgeries by hand know the worlds of the first drives
    drive = whose[rng.integers(len(whose))]
    if name not in ENTRIES:
        return (name, drive) if forged(KINDS[name], drives[drive], path) else None
    log = forgery_of(name, drives[drive], rng)
    if log is None:
        return None
    log.write(path)
    return name, drive


def accepted(finding: Finding) -> bool:
    """Return whether a forgery passed the level that must refuse it; an input with which the same drive follows is none."""
    if finding.level == CRASHED:
        return True
    same = finding.level == "none" and finding.kind in ENTRIES and ENTRIES[finding.kind].proof is Evidence.INPUT
    return not same and LEVELS.index(finding.level) > LEVELS.index(level_of(finding.kind))


def all_findings(drives: Mapping[str, Rollout], kinds: Mapping[str, Kind] = KINDS) -> list[Finding]:
    """Every forgery written by hand, in every drive, checked."""
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
    counted = {"count": (500, "forgeries to draw"), "seed": (0, "seed"), "first": (0, "number of the first draw")}
    chosen = command_line(  # type: ignore[arg-type]
        __doc__,
        kinds=([], "only kinds with one of these words"),
        few=(False, "only the drives of the tests"),
        **counted,
    )
    begun = time.monotonic()
    drives = genuine_drives() | ({} if chosen.few else more_drives(crossed()) | special_drives())
    POOL.extend(log.record.as_dict() for log in drives.values())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "forged.npz"
        for name, log in drives.items():
            log.save(path)
            assert found(path, log) == ("none", ""), f"{name}: {found(path, log)}"
            print(f"- {name}: {log.outcome.key}, {len(log.t)} rows, {certify(log).sentence}", flush=True)
        names = [name for name in (*ENTRIES, *KINDS) if any(word in name for word in chosen.kinds or [""])]
        results: list[Finding] = []
        for number in range(chosen.first, chosen.first + chosen.count):
            rng = np.random.default_rng([chosen.seed, number])
            while (one := drawn(drives, names, rng, path)) is None:
                pass
            try:
                finding = Finding(*one, *found(path, drives[one[1]]))
            except Exception as error:
                finding = Finding(*one, CRASHED, repr(error))
            results.append(finding)
            if accepted(finding):
                words = " ".join([*map(repr, chosen.kinds), f"--seed {chosen.seed} --first {number} --count 1"])
                print(
                    f"- ACCEPTED: {finding.kind} in {finding.drive} {finding.why[:150]}: python -m tests.audit.forgeries {words}",
                    flush=True,
                )
    print()
    rows = []
    for name in names:
        levels = collections.Counter(r.level for r in results if r.kind == name)
        why = next((r.why for r in results if r.kind == name and r.why), "")
        checked = [str(levels[level] or "") for level in LEVELS]
        past = str(sum(accepted(r) for r in results if r.kind == name) or "")
        rows.append([name, level_of(name), str(sum(levels.values())), *checked, past, why[:120].replace("|", "/")])
    total = collections.Counter(r.level for r in results)
    whole = [str(total[level]) for level in LEVELS]
    rows.append([f"all {len(names)} kinds", "", str(len(results)), *whole, str(sum(map(accepted, results))), ""])
    print_table(["forgery", "refused by", "logs", *LEVELS, "accepted", "for example"], rows)
    print(f"{len(drives)} drives, {len(JUDGE.reruns)} reruns, {time.monotonic() - begun:.0f} s")


if __name__ == "__main__":
    main()
