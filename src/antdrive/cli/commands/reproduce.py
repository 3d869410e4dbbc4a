"""`antdrive reproduce`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from antdrive.base.files import write_json
from antdrive.base.progress import bar
from antdrive.base.tables import file_lines, table
from antdrive.cli import options
from antdrive.cli.console import print_error, show
from antdrive.cli.options import argument, flag, option
from antdrive.cli.output import results_folder
from antdrive.views.run_folder import formats_of

if TYPE_CHECKING:
    from antdrive.runs.papers.claims import Verdict
    from antdrive.runs.papers.reproduction import ResultRow

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
    figures: options.Figures = "png",
    json: options.Json = False,
) -> None:
    """Repeat a paper's experiments and test its claims.

    Prints published beside measured figures, then each claim with our figure, its interval and verdict; reasons and settings
    are in the files. Draws the paper's figures. 50 seeds decide every claim; with fewer, a line counts the undecidable ones.
    Repeat the command to resume it.
    """
    from antdrive.runs.papers.experiments import PAPERS
    from antdrive.runs.papers.reproduction import RUNS_FOLDER, too_few_seeds
    from antdrive.runs.papers.reproduction import reproduce as repeat
    from antdrive.views.papers import draw_figures

    drawn = formats_of(figures) or ()
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
            files = reproduction.files | draw_figures(found, folder, drawn)
        result = {
            "rows": [vars(row) for row in reproduction.rows],
            "claims": reproduction.claims,
            "files": files,
            "kept": reproduction.kept,
        }
        write_json(folder / MARKER, {**facts, **result})
    lines = [
        *table(("solved", "planner on map, printed and ours"), map(_row, reproduction.rows), columns=COLUMNS),
        *table(("verdict", "row", "claim"), map(_claim, reproduction.verdicts), columns=COLUMNS),
    ]
    lines += file_lines(files)
    if reproduction.kept:
        count = f"{reproduction.kept} of {len(reproduction.rows)}"
        lines.append(f"{count} experiments reused from {folder / RUNS_FOLDER}")
    show(json, result, lines)


def _row(row: "ResultRow") -> tuple[str, str]:
    """Return how many runs were solved, and the experiment with the printed and our values; the files have all columns."""
    from antdrive.runs.papers.reproduction import HEADS, row_cells

    cells = dict(zip(HEADS, row_cells(row), strict=True))
    told = ", ".join(f"{head} {cells[head]}" for head in ("printed", "mean", "gap") if cells[head] != "–")
    return cells["solved"], f"{row.planner} on {cells['map']}: {row.quantity} {told}"


def _claim(verdict: "Verdict") -> tuple[str, str, str]:
    """Return a claim's verdict, number and sentence with our value; the files have all columns."""
    claim = verdict.claim
    reading = "" if claim.reading == "ours" else f" ({claim.reading})"
    return verdict.decision.value, claim.id, f"{claim.sentence}{reading}: {verdict.ours}"
