"""`antdrive reproduce`."""

from pathlib import Path
from typing import Annotated

from antdrive.base.files import write_json
from antdrive.cli import options
from antdrive.cli.console import bar, file_lines, print_error, show, table
from antdrive.cli.options import argument, flag, option
from antdrive.cli.output import results_folder
from antdrive.views.run_folder import suffixes

MARKER = "reproduce.json"
QUICK_SEEDS = 6


def reproduce(
    paper: Annotated[str, argument("PAPER", "han2007, suganthi2019, ibraheem2016, lee2008, hasan or all.")],
    out: options.Out = None,
    seeds: Annotated[int, option("NUMBER", "Number of seeds for each experiment.", min=1, max=1000)] = 10,
    quick: Annotated[
        bool, flag("A look: six seeds, fewer ant steps, two maps for each picture, no slow experiment.", "--quick")
    ] = False,
    jobs: options.Jobs = None,
    films: Annotated[bool, flag("Film a drive for each paper: its colony plans, a robot drives.", "--film")] = False,
    vector: options.Vector = False,
    json: options.Json = False,
) -> None:
    """Repeat a paper's experiments: printed against measured.

    Prints a table of what the paper printed beside what was measured, then each of the paper's claims with our figure, its
    interval, whether it holds, and why; and draws the paper's figures. With 50 seeds every claim can be decided; a line says how
    many cannot with fewer. The same command goes on where it was interrupted.
    """
    from antdrive.runs.papers.claims import VERDICT_HEADS, verdict_cells, verdict_facts
    from antdrive.runs.papers.experiments import PAPERS
    from antdrive.runs.papers.reproduction import HEADS, RUNS_FOLDER, row_cells, too_few_seeds
    from antdrive.runs.papers.reproduction import reproduce as repeat
    from antdrive.views.papers import draw_figures

    papers = list(PAPERS) if paper == "all" else [paper]
    seeds = min(seeds, QUICK_SEEDS) if quick else seeds
    few = too_few_seeds(papers, seeds, quick=quick)
    mark = "quick" if quick else f"{seeds}-seeds"
    with results_folder(out, Path("out") / f"reproduce-{paper}", MARKER, mark, told=False) as (folder, facts):
        if few:
            print_error(few)
        with bar("planning") as progress:
            found = repeat(papers, folder, seeds=seeds, jobs=jobs, quick=quick, progress=progress)
            files = dict(found.files)
            for one in papers:
                files |= draw_figures(one, found.of(one), folder, 1 if quick else min(seeds, 10), suffixes(vector))
                if films:
                    from antdrive.views.papers import film_paper

                    film = film_paper(one, folder)
                    files |= {} if film is None else {f"{one} film": str(film)}
        result = {
            "rows": [vars(row) for row in found.rows],
            "claims": [verdict_facts(verdict) for verdict in found.verdicts],
            "files": files,
            "kept": found.kept,
        }
        write_json(folder / MARKER, {**facts, **result})
    lines = [*table(HEADS, map(row_cells, found.rows)), *table(VERDICT_HEADS, map(verdict_cells, found.verdicts))]
    lines += file_lines(files)
    if found.kept:
        count = f"{found.kept} of {len(found.rows)}"
        lines.append(f"{count} experiments were done before and were taken from {folder / RUNS_FOLDER}")
    show(json, result, lines)
