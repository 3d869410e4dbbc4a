"""Mutation score of the tests, by cosmic-ray: `make mutants`.

`mutants.yaml` has the plan of each file. Mutants are drawn by a seed; the plan's own faults always run. Each changes its file
in a copy of the project and runs the file's tests in a new process. It is killed if a test fails or a time limit passes.
Survivors are listed. `--results FOLDER` keeps a session of cosmic-ray for each file, resumes it, and leaves it for `cr-report`.
"""

from __future__ import annotations

import hashlib
import itertools
import os
import random
import re
import shlex
import shutil
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import parso
import typer
import yaml
from cosmic_ray import plugins
from cosmic_ray.commands import init as list_mutants
from cosmic_ray.mutating import mutate_and_test
from cosmic_ray.operators.operator import Argument, Operator
from cosmic_ray.testing import run_tests
from cosmic_ray.work_db import use_db
from cosmic_ray.work_item import TestOutcome, WorkItem, WorkResult
from joblib import Parallel, delayed

from benchmarks.markdown import table

ROOT = Path(__file__).resolve().parents[1]
SOURCE = Path("src/antdrive")  # the files of plans are named from here
PLANS: dict[str, dict[str, Any]] = yaml.safe_load(Path(__file__).with_suffix(".yaml").read_text())
SEED = 1
LEFT_OUT = (".*", "out", "examples", "docs")
#: The kinds of faults that tests should notice; of the others many change nothing.
OPERATORS = re.compile(
    r"core/(NumberReplacer|AddNot|ReplaceAndWithOr|ReplaceOrWithAnd|ZeroIterationForLoop"
    r"|ReplaceComparisonOperator_(Lt_LtE|Lt_GtE|LtE_Lt|LtE_Gt|Gt_GtE|Gt_LtE|GtE_Gt|GtE_Lt|Eq_NotEq|NotEq_Eq|Is_IsNot|IsNot_Is)"
    r"|ReplaceBinaryOperator_(Add_Sub|Sub_Add|Mul_Div|Div_Mul))"
)
# Limit of a mutant's tests: at least [s], and times that of the unchanged code; of the tests on the unchanged code [s].
LEAST_TIME, MORE_TIME, BASELINE_TIME = 90.0, 5.0, 600.0


class Fault(Operator):  # type: ignore[misc]
    """A fault written by hand: a piece of a file and its replacement."""

    def __init__(self, name: str, was: str, now: str) -> None:
        self.name, self.was, self.now = name, was, now

    def mutation_positions(self, node: Any) -> Iterator[tuple[Any, Any]]:
        """Yield the place of the piece.

        Raises:
            StalePlan: the file does not have it once.
        """
        if node.type == "file_input":
            before, *after = node.get_code().split(self.was)
            if len(after) != 1:
                raise StalePlan(f"{self.name}: its file has {self.was!r} {len(after)} times, must once")
            line = before.count("\n") + 1
            yield (line, 0), (line + 1, 0)

    def mutate(self, node: Any, index: int) -> Any:
        """Return the changed file."""
        return parso.parse(node.get_code().replace(self.was, self.now))

    @classmethod
    def arguments(cls) -> Sequence[Argument]:
        """Return the keys of a fault in a plan."""
        return [
            Argument("name", "what it is"),
            Argument("was", "a piece of the file"),
            Argument("now", "its replacement"),
        ]

    @classmethod
    def examples(cls) -> Sequence[Any]:
        """Return none: `mutants.yaml` has them."""
        return ()


FAULT = "plan/Fault"
plugins.OPERATOR_PROVIDERS["plan"] = {"Fault": Fault}


class Fate(NamedTuple):
    """What became of a mutant: killed, timeout or alive; unjudged if the tests fail on the unchanged code."""

    fate: str
    mutant: str  # its operator, line and change


class StalePlan(Exception):
    """A plan names missing code or a missing file."""


def chosen(file: str, seed: int = SEED) -> list[WorkItem]:
    """Return the faults of a file's plan and drawn mutants, from each function in turn. Reads the file in the working directory.

    Raises:
        StalePlan: the file does not have a fault's piece once.
    """
    with use_db(":memory:") as everything:
        list_mutants([SOURCE / file], everything, {FAULT: PLANS[file].get("faults", ())})
        items = sorted(
            everything.work_items,
            key=lambda item: (item.mutations[0].start_pos, _operator(item), item.mutations[0].occurrence),
        )
    rng = random.Random(f"{seed} {file}")  # noqa: S311 - nothing is kept secret
    by_function: dict[str | None, list[WorkItem]] = {}
    for item in items:
        if OPERATORS.fullmatch(_operator(item)):
            by_function.setdefault(item.mutations[0].definition_name, []).append(item)
    groups = list(by_function.values())
    rng.shuffle(groups)
    for group in groups:
        rng.shuffle(group)
    turns = itertools.zip_longest(*groups)
    found = [item for turn in turns for item in turn if item]
    return [*(item for item in items if _operator(item) == FAULT), *found[: PLANS[file]["count"]]]


def _operator(item: WorkItem) -> str:
    return str(item.mutations[0].operator_name)


def judged(file: str, seed: int, results: Path) -> list[Fate]:
    """Run the mutants of a file that its session has not run yet, in a copy of the project. Return the fate of each."""
    plan, before = PLANS[file], Path.cwd()
    with tempfile.TemporaryDirectory(prefix="antdrive-mutants-") as folder:
        copy = Path(folder) / "project"
        shutil.copytree(before, copy, symlinks=True, ignore=shutil.ignore_patterns(*LEFT_OUT))
        os.chdir(copy)
        try:
            tests = [f"tests/{test}" for test in plan["tests"]]
            texts = [Path(name).read_bytes() for name in (SOURCE / file, *tests)]
            stamp = hashlib.sha256(b"\0".join([*texts, f"{seed} {plan}".encode()])).hexdigest()[:16]
            with use_db(results / f"{file.replace('/', '-')}-{stamp}.sqlite") as session:
                if not session.num_work_items:
                    session.add_work_items(chosen(file, seed))
                if session.pending_work_items:
                    _run(session, command_of(copy, tests, plain=plan.get("plain", False)))
                return [Fate(fate_of(done), described(item, done)) for item, done in session.completed_work_items]
        except ChildProcessError as error:
            return [Fate("unjudged", f"{file}: {error}")]
        finally:
            os.chdir(before)


def _run(session: Any, command: str) -> None:
    began = time.monotonic()
    outcome, said = run_tests(command, BASELINE_TIME)
    if outcome != TestOutcome.SURVIVED:
        raise ChildProcessError(f"on the unchanged code its tests fail\n{said[-1000:]}")
    limit = max(LEAST_TIME, MORE_TIME * (time.monotonic() - began))
    for item in session.pending_work_items:
        session.set_result(item.job_id, done := mutate_and_test(item.mutations, command, limit))
        typer.echo(f"{fate_of(done):8} {described(item, done)}", err=True)


def command_of(copy: Path, tests: Sequence[str], *, plain: bool) -> str:
    """Return the command that runs tests on a copy; PYTHONPATH comes before an editable installation of the original."""
    variables = [f"PYTHONPATH={copy / 'src'}", "OMP_NUM_THREADS=1", *(["NUMBA_DISABLE_JIT=1"] if plain else [])]
    ignored = ["-W", "ignore"] if plain else []  # numpy's numbers warn where compiled ones wrap around
    words = [sys.executable, "-m", "pytest", "-x", "--tb=line", "-p", "no:cacheprovider", *ignored, *tests]
    return shlex.join(["env", "-u", "PYTEST_ADDOPTS", *variables, *words])


def fate_of(done: WorkResult) -> str:
    """Return "killed", "timeout" or "alive"; "unjudged" if cosmic-ray itself failed."""
    if done.test_outcome not in (TestOutcome.SURVIVED, TestOutcome.KILLED):
        return "unjudged"
    return "alive" if not done.is_killed else "timeout" if done.output == "timeout" else "killed"


def described(item: WorkItem, done: WorkResult) -> str:
    """Describe a mutant in one line: place, operator, and the lines before and after."""
    (spec,), changed = item.mutations, (done.diff or "").splitlines()
    was, now = (
        " ".join(line[1:].strip() for line in changed if re.match(rf"\{sign}(?!\{sign})", line)) for sign in "-+"
    )
    operator = spec.operator_args.get("name", spec.operator_name.partition("/")[2])
    return f"{spec.module_path.relative_to(SOURCE)}:{spec.start_pos[0]} [{operator}] {was}  ->  {now}"


def report(fates: dict[str, list[Fate]]) -> Iterator[str]:
    """Yield a Markdown table of the counts by file, then each survivor. The score leaves unjudged mutants out."""
    everything, rows = [fate for group in fates.values() for fate in group], []
    for name, group in [*((f"`{file}`", group) for file, group in fates.items()), ("all", everything)]:
        count = Counter(one.fate for one in group)
        dead = count["killed"] + count["timeout"]
        score = f"{100 * dead / (dead + count['alive']):.0f} %" if dead + count["alive"] else "–"
        numbers = (len(group), dead, count["timeout"], count["alive"], count["unjudged"])
        rows.append((name, *map(str, numbers), score))
    yield from table("file | mutants | killed | of these by timeout | alive | not judged | score", rows)
    yield from (f"{one.fate}: {one.mutant}" for one in everything if one.fate in ("alive", "unjudged"))


def main(
    only: Annotated[list[str] | None, typer.Option(help="Only this file; may be given several times.")] = None,
    seed: Annotated[int, typer.Option(help="Another seed draws other mutants.")] = SEED,
    jobs: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
    results: Annotated[Path | None, typer.Option(help="Keep a session for each file here, and go on from it.")] = None,
) -> None:
    """Draw mutants, run the tests on each, and print the score.

    Exits with 1 if a fault of a plan stays alive, with 2 if the tests of a file do not pass on the unchanged code.
    """
    files = only or list(PLANS)
    if unknown := set(files) - set(PLANS):
        raise typer.BadParameter(f"{min(unknown)} has no plan; known: {', '.join(PLANS)}", param_hint="--only")
    os.chdir(ROOT)
    with tempfile.TemporaryDirectory() as temporary:
        folder = (results or Path(temporary)).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        groups = Parallel(jobs)(delayed(judged)(file, seed, folder) for file in files)
    typer.echo("\n".join(report(dict(zip(files, groups, strict=True)))))
    everything = [one for group in groups for one in group]
    names = [f"[{fault['name']}]" for file in files for fault in PLANS[file].get("faults", ())]
    if any(one.fate == "alive" and any(name in one.mutant for name in names) for one in everything):
        raise typer.Exit(1)
    if any(one.fate == "unjudged" for one in everything):
        raise typer.Exit(2)


if __name__ == "__main__":
    from tools import mutants

    typer.run(mutants.main)  # processes import the module, with its operator, where `__main__` would be sent by value
