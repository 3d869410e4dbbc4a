"""`antdrive worlds generate`."""

from pathlib import Path
from typing import Annotated

import typer

from antdrive.base.errors import InputError
from antdrive.cli import options
from antdrive.cli.console import print_files
from antdrive.cli.exits import SUCCEEDED
from antdrive.cli.parse import pair


def generate_world(
    kind: Annotated[
        str, typer.Argument(metavar="KIND", help="forest (Han's rule) or barn (the BARN cellular automaton).")
    ],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FILE", help="The world file to write.")],
    seed: options.Seed = 0,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            "-s",
            metavar="KEY=VALUE",
            help="Set an option of the generator, such as count=20 for a forest or fill=0.25 for a barn. "
            "May be repeated.",
        ),
    ] = None,
) -> int:
    """Write a random world."""
    import numpy as np

    from antdrive.worlds import GENERATORS, generate, save_task

    values = dict(pair(text) for text in settings or ())
    if kind not in GENERATORS:
        raise InputError(f"generate: unknown kind {kind!r}; choose from {', '.join(GENERATORS)}")
    task = generate(kind, np.random.default_rng(seed), values, name=out.stem, note=f"seed {seed}")
    save_task(task, out)
    print_files({"world": str(out)})
    return SUCCEEDED
