"""`antdrive reproduce`."""

from pathlib import Path
from typing import Annotated

import typer

from antdrive.base.atomic import claimed
from antdrive.cli import options
from antdrive.cli.compiling import compile_once
from antdrive.cli.console import bar, print_error, print_files, print_json, print_line, print_table
from antdrive.cli.exits import SUCCEEDED
from antdrive.cli.write import check_folder, free_folder, suffixes, this_command, write_marker

MARKER = "reproduce.json"
QUICK_SEEDS = 6


def reproduce(
    paper: Annotated[
        str, typer.Argument(metavar="PAPER", help="han2007, suganthi2019, ibraheem2016, lee2008, hasan or all.")
    ],
    out: options.Out = None,
    seeds: Annotated[
        int, typer.Option(min=1, max=1000, metavar="NUMBER", help="Number of seeds for each experiment.")
    ] = 10,
    quick: Annotated[
        bool,
        typer.Option(
            "--quick", help="A look: six seeds, fewer ant steps, two maps for each picture, no slow experiment."
        ),
    ] = False,
    jobs: Annotated[int, typer.Option(min=1, max=256, metavar="NUMBER", help="Number of processes.")] = 1,
    films: Annotated[
        bool, typer.Option("--films", help="Film a drive for each paper: its colony plans, a robot drives.")
    ] = False,
    vector: options.Vector = False,
    json: options.Json = False,
) -> int:
    """Repeat a paper's experiments: printed against measured.

    Prints a table of what the paper printed beside what was measured, then each of the paper's claims with our figure, its
    interval, whether it holds, and why; and draws the paper's figures. With 50 seeds every claim can be decided; a line says how
    many cannot with fewer. The same command goes on where it was interrupted.
    """
    from antdrive.runs.papers.experiments import PAPERS
    from antdrive.runs.papers.reproduce import HEADS, TRIALS, row_cells, too_few_seeds
    from antdrive.runs.papers.reproduce import reproduce as repeat
    from antdrive.runs.papers.verdicts import VERDICT_HEADS, verdict_cells, verdict_facts
    from antdrive.views.papers.drawing import draw_figures

    papers = list(PAPERS) if paper == "all" else [paper]
    seeds = min(seeds, QUICK_SEEDS) if quick else seeds
    few = too_few_seeds(papers, seeds, quick=quick)
    mark = "quick" if quick else f"{seeds}-seeds"
    folder = out or free_folder(Path("out") / f"reproduce-{paper}", MARKER, mark)
    check_folder(folder)
    if few:
        print_error(few)
    compile_once()
    with claimed(folder), bar("planning") as progress:
        found = repeat(papers, folder, seeds=seeds, jobs=jobs, quick=quick, progress=progress)
        files = dict(found.files)
        for one in papers:
            files |= draw_figures(one, found.of(one), folder, 1 if quick else min(seeds, 10), suffixes(vector))
            if films:
                from antdrive.views.papers.films import film_paper

                film = film_paper(one, folder)
                files |= {} if film is None else {f"{one} film": str(film)}
        result = {
            "rows": [vars(row) for row in found.rows],
            "claims": [verdict_facts(verdict) for verdict in found.verdicts],
            "files": files,
            "kept": found.kept,
        }
        write_marker(folder / MARKER, {"fingerprint": mark, "command": this_command(), **result})
    if json:
        print_json(result)
    else:
        print_table(HEADS, map(row_cells, found.rows))
        print_table(VERDICT_HEADS, map(verdict_cells, found.verdicts))
        print_files(files)
        if found.kept:
            count = f"{found.kept} of {len(found.rows)}"
            print_line(f"{count} experiments were done before and were taken from {folder / TRIALS}")
    return SUCCEEDED
