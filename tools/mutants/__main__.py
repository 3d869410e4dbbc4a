"""Mutation score of the tests: `make mutants`.

Mutants are sampled by a seed from every file of `plans.py`; those of `named.yaml` always run. Each runs the tests of its file
in a copy of the project. A mutant is killed if a test fails or its time limit passes. Mutants in `equivalent.yaml` are counted
separately. Survivors are listed. `--results FILE` resumes an interrupted run.

Existing tools do not fit: mutmut skips decorated functions, and all kernels are decorated. cosmic-ray edits the tree that it
runs in, which invalidates the kernel cache and recompiles all kernels for each mutant.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
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
from tools.mutants.running import SOURCE, BaselineUnfit, Copy, Processes

FATES = ("killed", "timeout", "equivalent", "alive", "unjudged")  # unjudged: the tests fail on the unchanged code
Fates = dict[str, list[tuple[Mutant, str]]]


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
    except StaleTable as error:
        typer.echo(f"error: {error}", err=True)
        raise typer.Exit(2) from None
    if list_only:
        typer.echo("\n".join(line_of(mutant) for group in mutants.values() for mutant in group))
        return
    fates = judged(mutants, jobs, results)
    typer.echo(json.dumps(as_data(fates), indent=1) if as_json else as_text(fates))
    everything = [entry for group in fates.values() for entry in group]
    named = {mutant.key for mutant in named_mutants()}
    if any(fate == "alive" and mutant.key in named for mutant, fate in everything):
        raise typer.Exit(1)
    if any(fate == "unjudged" for _, fate in everything):
        raise typer.Exit(2)


def chosen(only: list[str] | None, per_file: int | None, seed: int) -> dict[str, list[Mutant]]:
    """Return the mutants to run, file by file.

    Raises:
        StaleTable: one of the files has no plan.
    """
    unknown = [file for file in only or [] if file not in PLANS]
    if unknown:
        raise StaleTable(f"--only {unknown[0]}: not one of {', '.join(PLANS)}")
    named, mutants = named_mutants(), {}
    for file in only or PLANS:
        count = PLANS[file].count if per_file is None else per_file
        by_key = {mutant.key: mutant for mutant in [*drawn(file, count, seed), *(m for m in named if m.file == file)]}
        mutants[file] = sorted(by_key.values(), key=lambda mutant: mutant.line)
    return mutants


def judged(mutants: dict[str, list[Mutant]], jobs: int, results: Path | None) -> Fates:
    """Return the fate of every mutant: from `results`, or determined and appended to it."""
    processes, equivalent, known = Processes(), equivalents(), kept(results)
    waiting: dict[str, list[Mutant]] = {}
    fates: Fates = {}
    for file, group in mutants.items():
        fate_of = {m: "equivalent" if m.key in equivalent else known.get((*m.key, stamp(m.file))) for m in group}
        fates[file] = [(mutant, fate) for mutant, fate in fate_of.items() if fate is not None]
        waiting[file] = [mutant for mutant, fate in fate_of.items() if fate is None]

    def judge(file: str) -> None:
        copy, left = copies.get(), list(waiting[file])
        try:
            for mutant, fate in copy.fates(left.copy(), PLANS[file]):
                left.remove(mutant)
                fates[file].append((mutant, fate))
                typer.echo(f"{fate:8} {line_of(mutant)}", err=True)
                if results:
                    with results.open("a") as out:
                        out.write(json.dumps([*mutant.key, stamp(file), fate]) + "\n")
        except BaselineUnfit as error:
            typer.echo(f"error: {error}", err=True)
            fates[file] += [(mutant, "unjudged") for mutant in left]
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


def kept(results: Path | None) -> dict[tuple[str, ...], str]:
    """Read the fate of each mutant with its stamp from a results file."""
    lines = results.read_text().splitlines() if results and results.exists() else []
    return {tuple(entry[:-1]): entry[-1] for entry in map(json.loads, lines)}


@functools.cache
def stamp(file: str) -> str:
    """Return a hash of a file and its tests; fates are valid while it is unchanged."""
    texts = [(ROOT / name).read_bytes() for name in (f"{SOURCE}/{file}", *PLANS[file].files)]
    return hashlib.sha256(b"\0".join(texts)).hexdigest()[:16]


def line_of(mutant: Mutant) -> str:
    """Describe a mutant in one line: place, original and mutated code."""
    return f"{mutant.file}:{mutant.line} [{mutant.operator}] {mutant.was}  ->  {mutant.now}"


def counts(group: list[tuple[Mutant, str]]) -> dict[str, Any]:
    """Count mutants by fate. Return the counts and the fraction killed, including timeouts; None without valid mutants."""
    found = Counter(fate for _, fate in group)
    killed = found["killed"] + found["timeout"]
    score = killed / (killed + found["alive"]) if killed + found["alive"] else None
    return {"mutants": len(group), **{fate: found[fate] for fate in FATES}, "killed": killed, "score": score}


def as_data(fates: Fates) -> dict[str, Any]:
    """Return the result as plain values for JSON."""
    everything = [entry for group in fates.values() for entry in group]
    names = ("file", "line", "function", "operator", "was", "now")
    return {
        "total": counts(everything),
        "files": {file: counts(group) for file, group in fates.items()},
        "mutants": [{name: getattr(mutant, name) for name in names} | {"fate": fate} for mutant, fate in everything],
    }


def as_text(fates: Fates) -> str:
    """Return the result as a Markdown table and the list of survivors."""
    everything = [entry for group in fates.values() for entry in group]
    heads = ("file", "mutants", "killed", "of these by timeout", "equivalent", "alive", "not judged", "score")
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for file, group in [*((f"`{file}`", group) for file, group in fates.items()), ("all", everything)]:
        found = counts(group)
        score = "–" if found["score"] is None else f"{100 * found['score']:.0f} %"
        cells = (file, found["mutants"], *(found[fate] for fate in FATES), score)
        lines.append(f"| {' | '.join(map(str, cells))} |")
    alive = [mutant for mutant, fate in everything if fate == "alive"]
    return "\n".join([*lines, "", f"alive: {len(alive)}", *map(line_of, alive)])


if __name__ == "__main__":
    with contextlib.suppress(BrokenPipeError):
        try:
            typer.run(main)
        except KeyboardInterrupt:
            sys.exit(130)
