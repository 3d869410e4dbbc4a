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
COLUMNS = 80  # width of the tables in files and pipes


def reproduce(
    paper: Annotated[str, argument("PAPER", "han2007, suganthi2019, ibraheem2016, lee2008, hasan or all.")],
    out: options.Out = None,
    seeds: Annotated[int, option("NUMBER", "Seeds per experiment.", min=1, max=1000)] = 10,
    quick: Annotated[
        bool, flag("At most six seeds, fewer ant steps, two maps per figure, no slow experiments.", "--quick")
    ] = False,
    jobs: options.Jobs = None,
    films: Annotated[bool, flag("Film one plan and drive per paper.", "--film")] = False,
    vector: options.Vector = False,
    json: options.Json = False,
) -> None:
    """Repeat a paper's experiments and test its claims.

    Prints published beside measured figures, then each claim with our figure, its interval, verdict and reason. Draws the
    paper's figures. 50 seeds decide every claim; with fewer, a line counts the undecidable ones. Repeat the command to resume
    it.
    """
    from antdrive.runs.papers.claims import VERDICT_HEADS, verdict_cells
    from antdrive.runs.papers.experiments import PAPERS
    from antdrive.runs.papers.reproduction import HEADS, RUNS_FOLDER, row_cells, too_few_seeds
    from antdrive.runs.papers.reproduction import reproduce as repeat
    from antdrive.views.papers import draw_figures

    papers = list(PAPERS) if paper == "all" else [paper]
    seeds = min(seeds, QUICK_SEEDS) if quick else seeds
    few = too_few_seeds(papers, seeds, quick=quick)
    mark = "quick" if quick else f"{seeds}-seeds"
    with results_folder(out, Path("out") / f"reproduce-{paper}", MARKER, mark, write_manifest=False) as (folder, facts):
        if few:
            print_error(few)
        with bar("planning") as progress:
            reproduction = repeat(papers, folder, seeds=seeds, jobs=jobs, quick=quick, progress=progress)
            found = {one: reproduction.of(one) for one in papers}
            files = reproduction.files | draw_figures(found, folder, 1 if quick else min(seeds, 10), suffixes(vector))
            for one in papers:
                if films:
                    from antdrive.views.papers import film_paper

                    film = film_paper(one, folder)
                    files |= {} if film is None else {f"{one} film": str(film)}
        result = {
            "rows": [vars(row) for row in reproduction.rows],
            "claims": reproduction.claims,
            "files": files,
            "kept": reproduction.kept,
        }
        write_json(folder / MARKER, {**facts, **result})
    lines = [
        *table(HEADS, map(row_cells, reproduction.rows), columns=COLUMNS),
        *table(VERDICT_HEADS, map(verdict_cells, reproduction.verdicts), columns=COLUMNS),
    ]
    lines += file_lines(files)
    if reproduction.kept:
        count = f"{reproduction.kept} of {len(reproduction.rows)}"
        lines.append(f"{count} experiments reused from {folder / RUNS_FOLDER}")
    show(json, result, lines)
