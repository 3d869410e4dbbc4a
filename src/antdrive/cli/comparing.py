"""What `antdrive compare` compares: planners with their own options, paired by world and seed."""

from __future__ import annotations

import hashlib
import re
import shlex
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from antdrive.base.errors import InputError
from antdrive.cli.parse import pair
from antdrive.cli.scenario import GROUPS
from antdrive.cli.write import fingerprint

if TYPE_CHECKING:
    from antdrive.sim.pipeline import Run
    from antdrive.sim.scenario import Scenario

MAX_PLANNERS = 6
COMPARED = {
    "path_length_m": "planned m",
    "driven_length_m": "driven m",
    "duration_s": "s",
    "min_clearance_m": "least clearance m",
}


@dataclass(frozen=True)
class Entrant:
    """A planner with its options, as the command line names it.

    Attributes:
        label: what it is called in tables, folders and `--set`
        name: the planner's name
        settings: its own `--set` in the words of `antdrive run`
    """

    label: str
    name: str
    settings: tuple[str, ...] = ()


def check_worlds(words: Sequence[str]) -> None:
    """Check that there are worlds of these names, before anything is said about planners, which a campaign needs none of.

    Raises:
        InputError: there is no such world.
    """
    from antdrive.base.checks import suggest
    from antdrive.worlds.files.world_file import list_worlds

    known = list_worlds()
    for word in words:
        if word in known or Path(word).is_file():
            continue
        if Path(word).is_dir():
            raise InputError(f"{word}: neither a world file nor the folder of a campaign, as antdrive sweep writes it")
        raise InputError(f"{word}: no such file or folder, nor a world of the catalogue; {suggest(word, known)}")


def entrants_of(planners: Sequence[str] | None, settings: Sequence[str] | None) -> list[Entrant]:
    """The planners of `--planner NAME` or `--planner LABEL=NAME`, with the options of `--set GROUP.KEY=VALUE`.

    Raises:
        InputError: not two to six different labels, or a group that is none.
    """
    words, labels = planners or (), dict[str, str]()
    for word in words:
        label, mark, name = word.partition("=")
        if not label or (mark and not name) or label in GROUPS or (mark and not re.fullmatch(r"[\w-]{1,40}", label)):
            raise InputError(
                f"--planner {word}: write NAME or LABEL=NAME, such as few=aco-han, with a label of letters, digits, - and _"
            )
        labels[label] = name if mark else label
    if len(labels) < len(words) or not 2 <= len(labels) <= MAX_PLANNERS:
        raise InputError(
            f"{' '.join(['--planner', *words])}: name two to six different planners; "
            "one planner with other options gets a label, such as --planner few=aco-han --set few.ants=10"
        )
    own: dict[str, list[str]] = {label: [] for label in labels}
    for text in settings or ():
        key, value = pair(text)
        group, _, name = key.partition(".")
        if not name or group not in (*labels, *GROUPS):
            raise InputError(f"--set {text}: write GROUP.KEY=VALUE with a group of {', '.join([*labels, *GROUPS])}")
        for label in labels if group in GROUPS else [group]:
            own[label].append(f"{group if group == 'controller' else 'planner'}.{name}={value}")
    return [Entrant(label, name, tuple(own[label])) for label, name in labels.items()]


def mark_of(scenarios: Mapping[str, Scenario], cases: Sequence[tuple[str, int]]) -> str:
    """Eight hexadecimal digits that differ between comparisons."""
    facts = [f"{key} {fingerprint(scenario)}" for key, scenario in scenarios.items()]
    return hashlib.sha256(repr((facts, list(cases))).encode()).hexdigest()[:8]


def repeating(scenario: Scenario, entrant: Entrant, world: str, robot: str, ends: Sequence[str] = ()) -> str:
    """The `antdrive run` that repeats one of the compared runs."""
    given = {
        "--planner": entrant.name,
        "--robot": robot,
        "--seed": scenario.seed,
        "--margin": "auto" if scenario.chosen else scenario.margin,
        "--smoothing": scenario.smoothing,
        "--noise": scenario.noise,
    }
    words = [str(word) for option in given.items() for word in option]
    words += [word for text in entrant.settings for word in ("--set", text)]
    cell = [] if scenario.cell is None else ["--cell", str(scenario.cell)]
    return shlex.join(["antdrive", "run", world, *words, *ends, *cell])


@dataclass(frozen=True)
class Compared:
    """One run of a comparison, without its log.

    Attributes:
        label: of the planner
        world: the world's name
        seed: the random seed
        facts: what `Run.as_dict` says
        drive: a SHA-256 of what was driven, whatever was planned; empty if the robot did not drive
        plan: the planned line as bytes
    """

    label: str
    world: str
    seed: int
    facts: Mapping[str, Any]
    drive: str
    plan: bytes

    @classmethod
    def of(cls, label: str, run: Run) -> Compared:
        """What a comparison keeps of a run."""
        s, log = run.scenario, run.rollout
        # `drive_digest` covers the planned cells, too, which smoothing may make one route of.
        driven = () if log is None else (log.pose, log.twist, log.command, log.contacts, log.route)
        drive = hashlib.sha256(b"".join(array.tobytes() for array in driven)).hexdigest() if driven else ""
        return cls(label, s.task.world.name, s.seed, run.as_dict(), drive, run.plan.line.tobytes())

    @property
    def cells(self) -> tuple[str, ...]:
        """The values of `COMPARED`, for a row of a table."""
        if not self.drive:
            return ("-",) * len(COMPARED)
        return tuple(f"{self.facts['metrics'][name]:.3f}" for name in COMPARED)


def differences(runs: Sequence[Compared]) -> list[dict[str, Any]]:
    """For each planner but the first, how its drives differ from the first one's with the same world and seed.

    Only pairs in which both succeeded are compared; of each metric the median difference, the least and the most.
    """
    first = runs[0].label
    reference = {(run.world, run.seed): run for run in runs if run.label == first}
    found = []
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
        found.append(entry)
    return found


def difference_cells(entry: Mapping[str, Any]) -> tuple[str, ...]:
    """One entry of `differences` as a row of a table."""
    share = f"{entry['succeeded']}/{entry['runs']}"
    values = [entry[name] for name in COMPARED]
    texts = ["-" if v is None else f"{v[0]:+.3f} ({v[1]:+.3f} to {v[2]:+.3f})" for v in values]
    return (entry["planner"], share, str(entry["pairs"]), *texts)


def same_drives(runs: Sequence[Compared], smoothing: str) -> list[str]:
    """A sentence for every group of planners whose drives are the same, bit for bit."""
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
    told = []
    for (names, planned_alike), where in groups.items():
        place = f"in all {len(cases)} cases" if len(where) == len(cases) > 1 else "; ".join(where[:5])
        more = f" and {len(where) - 5} more" if len(where) > 5 and not place.startswith("in all") else ""
        why = "the same plan" if planned_alike else f"other plans, but --smoothing {smoothing} makes one route of them"
        told.append(f"{names}: the same drive ({why}): {place}{more}")
    return told
