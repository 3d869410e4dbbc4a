"""`antdrive reproduce`."""

from pathlib import Path
from typing import Annotated

import typer

from antdrive.sim.cli import options
from antdrive.sim.cli.compiling import compile_once
from antdrive.sim.cli.console import bar, print_files, print_json, print_table
from antdrive.sim.cli.exits import SUCCEEDED
from antdrive.sim.cli.write import check_folder, free_folder, suffixes, this_command, write_marker
from antdrive.worlds.files.atomic import claimed

MARKER = "reproduce.json"


def reproduce(
    paper: Annotated[
        str, typer.Argument(metavar="PAPER", help="han2007, suganthi2019, ibraheem2016, lee2008, hasan or all.")
    ],
    out: options.Out = None,
    seeds: Annotated[
        int, typer.Option(min=1, max=1000, metavar="NUMBER", help="Number of seeds for each experiment.")
    ] = 10,
    jobs: Annotated[int, typer.Option(min=1, max=256, metavar="NUMBER", help="Number of processes.")] = 1,
    vector: options.Vector = False,
    json: options.Json = False,
) -> int:
    """Repeat a paper's experiments: printed against measured.

    Prints a table of what the paper printed beside what was measured, and draws the paper's figures.
    """
    from antdrive.sim.papers.experiments import PAPERS
    from antdrive.sim.papers.reproduce import HEADS, check_papers, row_cells
    from antdrive.sim.papers.reproduce import reproduce as repeat

    papers = list(PAPERS) if paper == "all" else [paper]
    check_papers(papers)
    mark = f"{seeds}-seeds"
    folder = out or free_folder(Path("out") / f"reproduce-{paper}", MARKER, mark)
    check_folder(folder)
    compile_once()
    with claimed(folder), bar("planning") as progress:
        facts = {"fingerprint": mark, "command": this_command()}
        write_marker(folder / MARKER, facts)
        rows, files = repeat(papers, folder, seeds=seeds, suffixes=suffixes(vector), jobs=jobs, progress=progress)
        write_marker(folder / MARKER, {**facts, "rows": [vars(row) for row in rows], "files": files})
    if json:
        print_json({"rows": [vars(row) for row in rows], "files": files})
    else:
        print_table(HEADS, map(row_cells, rows))
        print_files(files)
    return SUCCEEDED
