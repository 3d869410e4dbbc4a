"""`antdrive render`."""

from pathlib import Path
from typing import Annotated, Any

import typer

from antdrive.base.errors import InputError
from antdrive.cli import options
from antdrive.cli.compiling import compile_once
from antdrive.cli.console import print_files, print_json
from antdrive.cli.exits import SUCCEEDED
from antdrive.cli.parse import log_at
from antdrive.cli.parse import size as parse_size
from antdrive.cli.write import caption, write_comparison_film, write_film


def render(
    rollouts: Annotated[
        list[Path],
        typer.Argument(metavar="ROLLOUT", help="Logs of drives or folders of runs; two to six are shown side by side."),
    ],
    out: Annotated[
        Path,
        typer.Option("--out", "-o", metavar="FILE", help="The film: .mp4, .gif or .webp; .png writes one frame."),
    ],
    camera: Annotated[str, typer.Option(metavar="NAME", help="Camera: oblique, top or follow.")] = "oblique",
    size: Annotated[
        str | None,
        typer.Option(
            metavar="WIDTHxHEIGHT",
            help="Size of the picture [px]. Of several drives from above as much of the default as their worlds fill.",
            show_default="1280x720",
        ),
    ] = None,
    fps: Annotated[int, typer.Option(min=1, max=240, metavar="NUMBER", help="Frames per second.")] = 30,
    speed: options.Speed = 1.0,
    at: Annotated[
        float | None,
        typer.Option(min=0.0, metavar="SECONDS", help="Write the one frame of this moment [s]: .png or .webp."),
    ] = None,
    prelude: options.Prelude = 0.0,
    json: options.Json = False,
) -> int:
    """Film drives from their logs, from any camera.

    Nothing is simulated again.
    """
    from antdrive.sim.log.rollout import Rollout

    logs = [Rollout.load(log_at(path)) for path in rollouts]
    shape = {} if size is None else {"size": parse_size(size)}
    one_frame = at is not None or out.suffix.lower() == ".png"
    if len(logs) > 1 and (prelude or one_frame):
        raise InputError(f"--out {out}: several rollouts give a film, without a prelude")
    compile_once()
    if one_frame:
        from antdrive.views.film.video import still

        still(logs[0], out, at, camera=camera, **shape, note=caption(logs[0]))
        facts: dict[str, Any] = {"file": str(out), "frames": 1}
    elif len(logs) > 1:
        facts = write_comparison_film(logs, out, camera=camera, **shape, fps=fps, speed=speed)
    else:
        facts = write_film(logs[0], out, camera=camera, **shape, fps=fps, speed=speed, prelude=prelude)
    if json:
        print_json(facts)
    else:
        print_files({"film": facts["file"]})
    return SUCCEEDED
