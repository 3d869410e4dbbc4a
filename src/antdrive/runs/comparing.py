"""Drives of several planners, paired by world and seed."""

from __future__ import annotations

import dataclasses
import hashlib
import os
import statistics
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeAlias

from antdrive.base.errors import FieldError, few
from antdrive.base.tables import marked, rounded_down, table
from antdrive.sim.settings import COMPARED_SMOOTHING

if TYPE_CHECKING:
    from antdrive.base.components import ComponentError
    from antdrive.planners import Planner
    from antdrive.robots import RobotSpec
    from antdrive.sim.log.rollout import Rollout
    from antdrive.sim.pipeline import Run
    from antdrive.sim.scenario import Scenario
    from antdrive.worlds import Task

FAULTS = "planner_fault", "controller_fault"  # outcomes of runs whose planner or controller raised an error

COMPARED = {
    "path_length_m": "planned m",
    "driven_length_m": "driven m",
    "duration_s": "s",
    "min_clearance_m": "clearance m",
}
PATH = "planned → driven m"  # heading of `path_text`


def drive_hash(log: Rollout) -> str:
    """Return the SHA-256 of a drive alone: its world, its route and its arrays, without the plan behind the route."""
    # `Rollout.digest` also covers the planned cells, which smoothing may turn into the same route.
    arrays = (log.pose, log.twist, log.command, log.contacts, log.route)
    name = log.record.task.world.name.encode()
    return hashlib.sha256(name + b"".join(array.tobytes() for array in arrays)).hexdigest()


#: Names and logs of one drive, which are bitwise identical but for their plans.
SameDrive: TypeAlias = "Sequence[tuple[str, Rollout]]"


def distinct(drives: Iterable[tuple[str, Rollout]]) -> list[SameDrive]:
    """Group named logs by drive, in order."""
    found: dict[str, list[tuple[str, Rollout]]] = {}
    for name, log in drives:
        found.setdefault(drive_hash(log), []).append((name, log))
    return list(found.values())


def path_text(planned: Iterable[float], driven: float) -> str:
    """Return planned and driven lengths [m], such as `20.34 → 19.87`; different plans of one drive are all named."""
    return f"{', '.join(dict.fromkeys(f'{length:.2f}' for length in planned))} → {driven:.2f}"


@dataclass(frozen=True)
class Compared:
    """A run of a comparison, without its log.

    Attributes:
        label: the planner's label
        world: the world's name
        seed: the random seed
        facts: `Run.as_dict` and the folder
        drive: a hash of the drive without its plan; empty without a drive
        plan: the planned line as bytes
    """

    label: str
    world: str
    seed: int
    facts: Mapping[str, Any]
    drive: str = ""
    plan: bytes = b""

    @classmethod
    def of(cls, label: str, s: Scenario, result: Run | ComponentError, folder: str | None) -> Compared:
        """Return a run without its log, or the error of its planner as a run."""
        if isinstance(result, Exception):
            facts = {**s.as_dict(), "outcome": result.outcome, "sentence": str(result), "reason": str(result)}
            facts |= {"succeeded": False, "certificate": None, "metrics": {}, "digest": None, "folder": None}
            return cls(label, s.task.world.name, s.seed, facts)
        drive = "" if result.rollout is None else drive_hash(result.rollout)
        facts = {**result.as_dict(), "folder": folder}
        return cls(label, s.task.world.name, s.seed, facts, drive, result.plan.line.tobytes())


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """Runs of several planners in the same worlds with the same seeds.

    Attributes:
        runs: the runs, by world, seed and planner
        logs: the logs of the first world and seed, by label; planners without a path have none
    """

    runs: tuple[Compared, ...]
    logs: Mapping[str, Rollout] = field(default_factory=dict)

    @property
    def labels(self) -> tuple[str, ...]:
        """The planners' labels, in order."""
        return tuple(dict.fromkeys(run.label for run in self.runs))

    @property
    def cases(self) -> dict[tuple[str, int], list[Compared]]:
        """The runs by world and seed."""
        found: dict[tuple[str, int], list[Compared]] = {}
        for run in self.runs:
            found.setdefault((run.world, run.seed), []).append(run)
        return found

    @property
    def headings(self) -> tuple[str, ...]:
        """Headings of `rows`."""
        where = ("world", "seed") if len(self.cases) > 1 else ()
        ended = () if self.succeeded else ("outcome",)
        return (*where, "planner", PATH, "s", "clearance m", "certified m", *ended)

    @property
    def succeeded(self) -> bool:
        """Whether every run succeeded."""
        return all(run.facts["succeeded"] for run in self.runs)

    @property
    def rows(self) -> list[tuple[str, ...]]:
        """Cells of the table: one row for each different drive, with all planners that drive it."""
        return [self._row(same) for runs in self.cases.values() for same in _groups(runs)]

    def lines(self) -> Iterator[str]:
        """Yield the runs, differences between planners, and equal drives as lines."""
        rows = self.rows
        if not self.succeeded:
            rows = [(*cells, marked(ended == "succeeded", ended)) for *cells, ended in rows]
        yield from table(self.headings, rows)
        if len(self.cases) > 1:
            yield f"differences from {self.labels[0]} where both succeeded: median (minimum to maximum)"
            heads = ("planner", "succeeded", "pairs", *COMPARED.values())
            yield from table(heads, map(difference_cells, self.differences))
        if self.succeeded:
            yield marked(True, f"all {len(self.runs)} runs succeeded")
        yield from self.same

    def _row(self, same: Sequence[Compared]) -> tuple[str, ...]:
        first = same[0]
        where = (first.world, str(first.seed)) if len(self.cases) > 1 else ()
        values, certificate = first.facts["metrics"], first.facts["certificate"]
        cells = ("-", "-", "-")
        if first.drive:
            path = path_text((run.facts["metrics"]["path_length_m"] for run in same), values["driven_length_m"])
            cells = (path, f"{values['duration_s']:.2f}", f"{values['min_clearance_m']:.3f}")
        certified = certificate is not None and certificate["certified"]
        ended = "succeeded" if first.facts["succeeded"] else first.facts["sentence"]
        return (
            *(*where, ", ".join(run.label for run in same), *cells),
            f"≥ {rounded_down(certificate['bound_m'], 3):.3f}" if certified else "-",
            *([] if self.succeeded else [ended]),
        )

    @property
    def differences(self) -> list[dict[str, Any]]:
        """Each planner's drives compared with the first planner's in the same world and with the same seed.

        Pairs count if both succeeded. Each entry holds the median, least and largest difference of every metric.
        """
        first = self.labels[0]
        reference = {(run.world, run.seed): run for run in self.runs if run.label == first}
        entries = []
        for label in self.labels:
            mine = [run for run in self.runs if run.label == label]
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

    @property
    def same(self) -> list[str]:
        """A sentence for every group of planners with bitwise identical drives."""
        where: dict[tuple[str, str], list[str]] = {}
        for (world, seed), runs in self.cases.items():
            for same in _groups(runs):
                if len(same) > 1:
                    alike = len({run.plan for run in same}) == 1
                    smoothing = same[0].facts["smoothing"]
                    why = "" if alike else f": smoothing {smoothing} makes one route of their different plans"
                    names = _listed([run.label for run in same])
                    where.setdefault((names, why), []).append(f"{world}, seed {seed}")
        return [f"{names} drive the same line{why}{self._places(places)}" for (names, why), places in where.items()]

    def _places(self, places: Sequence[str]) -> str:
        if len(self.cases) == 1:
            return ""
        if len(places) == len(self.cases):
            return f" (in all {len(places)} cases)"
        return f" ({few(places, 5, '; ')})"

    def as_dict(self) -> dict[str, Any]:
        """Return plain values, for JSON."""
        drives = [{"label": run.label, **run.facts} for run in self.runs]
        return {"differences": self.differences, "same": self.same, "drives": drives}

    def to_markdown(self) -> str:
        """Return the table and the sentences of `same` as Markdown."""
        rule = ["---"] * len(self.headings)
        table = "\n".join(f"| {' | '.join(cells)} |" for cells in (self.headings, rule, *self.rows))
        return "\n\n".join([table, *(f"{sentence}." for sentence in self.same)])

    _repr_markdown_ = to_markdown

    def __repr__(self) -> str:
        worlds = _listed(list(dict.fromkeys(run.world for run in self.runs)))
        good = sum(run.facts["succeeded"] for run in self.runs)
        return f"<Comparison of {_listed(self.labels)} in {worlds}: {good} of {len(self.runs)} runs succeeded>"


def _groups(runs: Sequence[Compared]) -> Iterator[list[Compared]]:
    """Yield the runs of one world and seed by drive; a run without a drive is a group of its own."""
    groups: dict[str, list[Compared]] = {}
    for run in runs:
        groups.setdefault(run.drive or f"none: {run.label}", []).append(run)
    yield from groups.values()


def _listed(names: Sequence[str]) -> str:
    """Return names as `a, b and c`."""
    return " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))


def difference_cells(entry: Mapping[str, Any]) -> tuple[str, ...]:
    """Return one entry of `Comparison.differences` as a row of a table."""
    share = f"{entry['succeeded']}/{entry['runs']}"
    values = [entry[name] for name in COMPARED]
    texts = ["-" if v is None else f"{v[0]:+.3f} ({v[1]:+.3f} to {v[2]:+.3f})" for v in values]
    return (entry["planner"], share, str(entry["pairs"]), *texts)


#: Makes one run of a comparison: returns the run, or its planner's error, and the folder with its files, if any.
MakeRun: TypeAlias = "Callable[[str, Scenario], tuple[Run | ComponentError, str | None]]"


def _made(label: str, scenario: Scenario) -> tuple[Run | ComponentError, str | None]:
    """Drive without writing files."""
    from antdrive.base.components import ComponentError
    from antdrive.sim.pipeline import run

    try:
        return run(scenario), None
    except ComponentError as error:
        return error, None


def compare(
    worlds: str | os.PathLike[str] | Task | Sequence[str | os.PathLike[str] | Task],
    planners: Sequence[str | Planner] | Mapping[str, str | Planner],
    robot: str | os.PathLike[str] | RobotSpec = "turtlebot",
    *,
    options: Mapping[str, Mapping[str, Any]] = MappingProxyType({}),
    seeds: int | Sequence[int] = 1,
    **settings: Any,
) -> Comparison:
    """Drive every planner in every world with every seed and return the table.

    >>> from antdrive import compare
    >>> compare(["gate", task], ["aco-han", "astar"])
    <Comparison of aco-han and astar in gate and small: 4 of 4 runs succeeded>

    Planners drive their own plans: `smoothing` is none unless given.

    Args:
        worlds: one or several worlds of the catalogue, world files, or tasks
        planners: names or planners, which are called by their class; or both by label
        robot: a robot of the catalogue, a robot file, or a specification
        options: options of planners given by name, by label
        seeds: a number of seeds, from 0 on, or the seeds
        settings: fields of `Scenario`, such as noise=1.0

    Raises:
        InputError: a world, planner, option or robot is unknown, or a file is invalid.
        ValueError: fewer than two planners, worlds of the same name, or a setting is out of range.
    """
    from antdrive.sim.scenario import Scenario

    places = [worlds] if not isinstance(worlds, Sequence) or isinstance(worlds, str) else list(worlds)
    planners = [planners] if isinstance(planners, str) else planners
    listed = [] if isinstance(planners, Mapping) else [(_name_of(one), one) for one in planners]
    named = dict(planners if isinstance(planners, Mapping) else listed)
    if len(named) < len(listed):
        raise FieldError("planners", "two have the same name; write {LABEL: PLANNER}")
    numbers = list(range(seeds)) if isinstance(seeds, int) else list(seeds)
    if len(named) < 2:
        raise FieldError("planners", f"a comparison needs two or more, got {_listed(list(named)) or 'none'}")
    for label in options:
        if label not in named:
            raise FieldError("options", f"unknown planner {label!r}; choose from {', '.join(named)}")
    if not places or not numbers:
        raise FieldError("seeds" if places else "worlds", "must not be empty")
    settings = {"smoothing": COMPARED_SMOOTHING, **settings}
    scenarios = {
        label: [Scenario.of(world, planner, robot, options=options.get(label), **settings) for world in places]
        for label, planner in named.items()
    }
    return compare_scenarios(scenarios, numbers)


def _name_of(planner: str | Planner) -> str:
    return planner if isinstance(planner, str) else type(planner).__name__


def compare_scenarios(
    scenarios: Mapping[str, Sequence[Scenario]], seeds: Sequence[int], make: MakeRun = _made
) -> Comparison:
    """Run scenarios with every seed and return the table.

    Args:
        scenarios: each planner's scenarios, one per world, in the same order, by label
        seeds: the seeds; those of the scenarios do not count
        make: makes one run

    Raises:
        ValueError: two worlds have the same name.
    """
    worlds = [scenario.task.world.name for scenario in next(iter(scenarios.values()))]
    if len(set(worlds)) < len(worlds):
        raise FieldError("worlds", f"names must be unique, got {', '.join(worlds)}")
    runs: list[Compared] = []
    logs: dict[str, Rollout] = {}
    for place in range(len(worlds)):
        for seed in seeds:
            for label, scenario in ((label, several[place]) for label, several in scenarios.items()):
                seeded = dataclasses.replace(scenario, seed=seed)
                result, folder = make(label, seeded)
                runs.append(Compared.of(label, seeded, result, folder))
                if len(runs) <= len(scenarios) and not isinstance(result, Exception) and result.rollout is not None:
                    logs[label] = result.rollout
    return Comparison(tuple(runs), logs)
