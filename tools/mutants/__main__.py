"""`make mutants`: how many small faults do the tests notice?

Mutants are drawn by a seed from every file of `plans.py`; those of `named.yaml` are always run. Each runs the tests of its file
in a copy of the project. A mutant that a test notices is killed, one that outlasts its time limit too, and one that is in
`equivalent.yaml` counts apart. What stays alive is listed. With `--results FILE` an interrupted run goes on where it ended.

The generator is ours because neither of the known tools fits. mutmut leaves out decorated functions, and all kernels are
decorated. cosmic-ray changes the files of the tree that it runs in, with every mutant of a kernel the stamp of the cache changes,
and all kernels would compile anew for each.
"""

from __future__ import annotations

import contextlib
import json
import queue
import signal
import sys
import tempfile
import threading
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Annotated, Any

import typer

from tools.mutants.operators import Mutant
from tools.mutants.plans import PLANS, ROOT, SEED, StaleTable, check_tables, drawn, equivalents, named_mutants
from tools.mutants.results import Results, ResultsUnfit
from tools.mutants.running import BaselineUnfit, Copy, Plan, Processes

Fates = dict[
    str, list[tuple[Mutant, str]]
]  # "killed", "timeout", "equivalent", "alive", or "unjudged" where the tests are unfit


def main(
    only: Annotated[list[str] | None, typer.Option(help="Only this file; may be given several times.")] = None,
    per_file: Annotated[int | None, typer.Option(min=0, help="Draw so many mutants of each file.")] = None,
    seed: Annotated[int, typer.Option(help="Another seed draws other mutants.")] = SEED,
    jobs: Annotated[int, typer.Option(min=1, max=2, help="Processes.")] = 2,
    results: Annotated[
        Path | None, typer.Option(help="Keep what became of each mutant here, and go on from it.")
    ] = None,
    list_only: Annotated[bool, typer.Option("--list", help="List the mutants and run none.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Draw mutants, run the tests on each, and print the score.

    Exits with 1 if a named mutant stays alive, with 2 if the tests of a file do not pass on the unchanged code.
    """
    try:
        check_tables()
        mutants = chosen(only, per_file, seed)
        if list_only:
            for mutant in (mutant for group in mutants.values() for mutant in group):
                typer.echo(line_of(mutant))
            return
        fates = judged(mutants, jobs, Results(results))
    except (StaleTable, ResultsUnfit) as error:
        typer.echo(f"error: {error}", err=True)
        raise typer.Exit(2) from None
    typer.echo(json.dumps(as_data(fates), indent=1) if as_json else as_text(fates))
    named = {mutant.key for mutant in named_mutants()}
    if any(fate == "alive" and mutant.key in named for group in fates.values() for mutant, fate in group):
        raise typer.Exit(1)
    if any(fate == "unjudged" for group in fates.values() for _, fate in group):
        raise typer.Exit(2)


def chosen(only: list[str] | None, per_file: int | None, seed: int) -> dict[str, list[Mutant]]:
    """The mutants to run, file by file, the named ones first.

    Raises:
        StaleTable: one of the files has no plan.
    """
    unknown = [file for file in only or [] if file not in PLANS]
    if unknown:
        raise StaleTable(f"--only {unknown[0]}: not one of {', '.join(PLANS)}")
    named = named_mutants()
    mutants = {}
    for file in only or PLANS:
        count = PLANS[file].count if per_file is None else per_file
        by_key = {mutant.key: mutant for mutant in [*drawn(file, count, seed), *(m for m in named if m.file == file)]}
        mutants[file] = sorted(by_key.values(), key=lambda mutant: mutant.line)
    return mutants


def judged(mutants: dict[str, list[Mutant]], jobs: int, results: Results) -> Fates:
    """The fate of every mutant.

    Args:
        mutants: the mutants of each file
        jobs: how many files are judged at once
        results: the fates of earlier runs, which are taken as they are; new ones are added
    """
    processes, known = Processes(), equivalents()
    waiting: dict[str, list[Mutant]] = {}
    fates: Fates = {}
    for file, group in mutants.items():
        fate_of = {m: "equivalent" if m.key in known else results.fate(m) for m in group}
        fates[file] = [(mutant, fate) for mutant, fate in fate_of.items() if fate is not None]
        waiting[file] = [mutant for mutant, fate in fate_of.items() if fate is None]

    def judge(file: str) -> None:
        copy = copies.get()
        try:
            _judge_file(copy, PLANS[file], waiting[file], fates[file], results)
        finally:
            copies.put(copy)
        fates[file].sort(key=lambda entry: entry[0].line)

    def end(*_: Any) -> None:
        raise KeyboardInterrupt

    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, end)
    with tempfile.TemporaryDirectory(prefix="antdrive-mutants-") as folder:
        copies: queue.Queue[Copy] = queue.Queue()
        for job in range(min(jobs, sum(map(bool, waiting.values())))):
            copies.put(Copy(ROOT, Path(folder) / str(job) / "project", processes))
        pool = ThreadPoolExecutor(jobs)  # each job has a copy while it judges a file
        try:
            for done in [pool.submit(judge, file) for file in mutants if waiting[file]]:
                done.result()
        finally:
            processes.stop()
            pool.shutdown(cancel_futures=True)
    return fates


def _judge_file(
    copy: Copy, plan: Plan, mutants: list[Mutant], fates: list[tuple[Mutant, str]], results: Results
) -> None:
    judged_here = len(fates)
    try:
        for mutant, fate in copy.fates(mutants, plan):
            fates.append((mutant, fate))
            results.add(mutant, fate)
            typer.echo(f"{fate:8} {line_of(mutant)}", err=True)
    except BaselineUnfit as error:
        typer.echo(f"error: {error}", err=True)
        fates += [(mutant, "unjudged") for mutant in mutants[len(fates) - judged_here :]]


def line_of(mutant: Mutant) -> str:
    """A mutant as one line: where it is, what was there and what is."""
    where = f"{mutant.file}:{mutant.line}"
    return f"{where} [{mutant.operator}] {mutant.was}  ->  {mutant.now}"


def counts(group: list[tuple[Mutant, str]]) -> dict[str, Any]:
    """How many mutants met which fate, and the share of those killed among all that were judged and are not equivalent.

    The share is None if there are none.
    """
    found = Counter(fate for _, fate in group)
    killed = found["killed"] + found["timeout"]
    judged_all = killed + found["alive"]
    return {
        "mutants": len(group),
        "killed": killed,
        "by_timeout": found["timeout"],
        "equivalent": found["equivalent"],
        "alive": found["alive"],
        "unjudged": found["unjudged"],
        "score": killed / judged_all if judged_all else None,
    }


def as_data(fates: Fates) -> dict[str, Any]:
    """The result as plain values, for JSON."""
    everything = [entry for group in fates.values() for entry in group]
    return {
        "total": counts(everything),
        "files": {file: counts(group) for file, group in fates.items()},
        "mutants": [
            {key: getattr(mutant, key) for key in ("file", "line", "function", "operator", "was", "now")} | {"fate": fate}
            for mutant, fate in everything
        ],
    }  # fmt: skip


def as_text(fates: Fates) -> str:
    """The result as a table in Markdown and the list of survivors."""
    everything = [entry for group in fates.values() for entry in group]
    lines = [
        "| file | mutants | killed | of these by timeout | equivalent | alive | not judged | score |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for file, group in [*((f"`{file}`", group) for file, group in fates.items()), ("all", everything)]:
        found = counts(group)
        score = "–" if found["score"] is None else f"{100 * found['score']:.0f} %"
        keys = ("mutants", "killed", "by_timeout", "equivalent", "alive", "unjudged")
        cells = (file, *(found[key] for key in keys), score)
        lines.append(f"| {' | '.join(map(str, cells))} |")
    alive = [mutant for mutant, fate in everything if fate == "alive"]
    return "\n".join([*lines, "", f"alive: {len(alive)}", *map(line_of, alive)])


if __name__ == "__main__":
    with contextlib.suppress(BrokenPipeError):
        try:
            typer.run(main)
        except KeyboardInterrupt:
            sys.exit(130)
