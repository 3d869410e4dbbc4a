"""Drives of several planners, paired by world and seed."""

from __future__ import annotations

import hashlib
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from antdrive.planners import PlannerError
    from antdrive.sim.pipeline import Run
    from antdrive.sim.scenario import Scenario

PLANNER_FAULT = "planner_fault"  # outcome of a run whose planner raised an error

COMPARED = {
    "path_length_m": "planned m",
    "driven_length_m": "driven m",
    "duration_s": "s",
    "min_clearance_m": "minimum clearance m",
}


def mark_of(scenarios: Mapping[str, Scenario], cases: Sequence[tuple[str, int]]) -> str:
    """Return eight hexadecimal digits that identify a comparison."""
    facts = [f"{key} {scenario.identity()[:8]}" for key, scenario in scenarios.items()]
    return hashlib.sha256(repr((facts, list(cases))).encode()).hexdigest()[:8]


@dataclass(frozen=True)
class Compared:
    """A run of a comparison, without its log."""

    label: str  # the planner's label
    world: str  # the world's name
    seed: int  # the random seed
    facts: Mapping[str, Any]  # `Run.as_dict`
    drive: str  # SHA-256 of the drive alone, without its plan; empty without a drive
    plan: bytes  # the planned line as bytes

    @classmethod
    def of(cls, label: str, run: Run, folder: str) -> Compared:
        """Return a run without its log."""
        s, log = run.scenario, run.rollout
        # `drive_digest` also covers the planned cells, which smoothing may turn into the same route.
        driven = () if log is None else (log.pose, log.twist, log.command, log.contacts, log.route)
        drive = hashlib.sha256(b"".join(array.tobytes() for array in driven)).hexdigest() if driven else ""
        facts = {**run.as_dict(), "folder": folder}
        return cls(label, s.task.world.name, s.seed, facts, drive, run.plan.line.tobytes())

    @classmethod
    def failed(cls, label: str, s: Scenario, error: PlannerError) -> Compared:
        """Return a run that ended in an error of the planner."""
        facts = {**s.as_dict(), "outcome": PLANNER_FAULT, "sentence": str(error), "reason": str(error)}
        facts |= {"succeeded": False, "certificate": None, "metrics": {}, "digest": None, "folder": None}
        return cls(label, s.task.world.name, s.seed, facts, "", b"")

    @property
    def cells(self) -> tuple[str, ...]:
        """The values of `COMPARED`, for a row of a table."""
        if not self.drive:
            return ("-",) * len(COMPARED)
        return tuple(f"{self.facts['metrics'][name]:.3f}" for name in COMPARED)


def differences(runs: Sequence[Compared]) -> list[dict[str, Any]]:
    """Compare each planner's drives with the first planner's in the same world and with the same seed.

    Pairs count if both succeeded. Each entry holds the median, least and largest difference of every metric.
    """
    first = runs[0].label
    reference = {(run.world, run.seed): run for run in runs if run.label == first}
    entries = []
    for label in dict.fromkeys(run.label for run in runs):
        mine = [run for run in runs if run.label == label]
        pairs = [(run, reference[run.world, run.seed]) for run in mine]
        both = [(a, b) for a, b in pairs if a.facts["succeeded"] and b.facts["succeeded"]]
        entry: dict[str, Any] = {
            "planner": label,
            "succeeded": sum(run.facts["succeeded"] for run in mine),
            "runs": len(mine),
            "pairs": len(both),
        }
        for name in COMPARED:
            apart = [a.facts["metrics"][name] - b.facts["metrics"][name] for a, b in both]
            entry[name] = [statistics.median(apart), min(apart), max(apart)] if apart and label != first else None
        entries.append(entry)
    return entries


def difference_cells(entry: Mapping[str, Any]) -> tuple[str, ...]:
    """Return one entry of `differences` as a row of a table."""
    share = f"{entry['succeeded']}/{entry['runs']}"
    values = [entry[name] for name in COMPARED]
    texts = ["-" if v is None else f"{v[0]:+.3f} ({v[1]:+.3f} to {v[2]:+.3f})" for v in values]
    return (entry["planner"], share, str(entry["pairs"]), *texts)


def same_drives(runs: Sequence[Compared], smoothing: str) -> list[str]:
    """Return a sentence for every group of planners with bitwise identical drives."""
    groups: dict[tuple[str, bool], list[str]] = {}
    cases: dict[tuple[str, int], dict[str, list[Compared]]] = {}
    for run in runs:
        if run.drive:
            cases.setdefault((run.world, run.seed), {}).setdefault(run.drive, []).append(run)
    for (world, seed), drives in cases.items():
        for same in drives.values():
            if len(same) > 1:
                names = " and ".join(run.label for run in same)
                groups.setdefault((names, len({run.plan for run in same}) == 1), []).append(f"{world}, seed {seed}")
    sentences = []
    for (names, planned_alike), where in groups.items():
        place = f"in all {len(cases)} cases" if len(where) == len(cases) > 1 else "; ".join(where[:5])
        more = f" and {len(where) - 5} more" if len(where) > 5 and not place.startswith("in all") else ""
        why = "the same plan" if planned_alike else f"different plans, but the same route after --smoothing {smoothing}"
        sentences.append(f"{names}: the same drive ({why}): {place}{more}")
    return sentences
