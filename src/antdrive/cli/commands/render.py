"""`antdrive render`."""

from pathlib import Path
from typing import Annotated, Any

from antdrive.base.errors import InputError
from antdrive.base.tables import file_lines
from antdrive.cli import options
from antdrive.cli.console import show
from antdrive.cli.options import argument, option
from antdrive.cli.output import film_drives
from antdrive.cli.parse import size as parse_size


def render(
    rollouts: Annotated[list[Path], argument("ROLLOUT", "Logs or folders of runs; two to six play side by side.")],
    out: Annotated[Path, option("FILE", "Film (.mp4, .gif, .webp) or frame (.png).")],
    camera: Annotated[str, option("NAME", "View: oblique, top or follow.")] = "oblique",
    size: Annotated[
        str | None,
        option(
            "WIDTHxHEIGHT",
            "Picture size [px]; several drives in top view crop the default to their worlds.",
            show_default="1280x720",
        ),
    ] = None,
    fps: Annotated[int, option("NUMBER", "Frames per second.", min=1, max=240)] = 30,
    speed: options.Speed = 1.0,
    at: Annotated[float | None, option("SECONDS", "Write the frame at this time [s] (.png or .webp).", min=0.0)] = None,
    prelude: options.Prelude = 0.0,
    planner: options.LogPlanner = None,
    json: options.Json = False,
) -> None:
    """Render films of logged drives from any camera.

    Films replay the log, without physics.
    """
    from antdrive.planners import load_planner
    from antdrive.sim.log.rollout import Rollout, log_at

    if planner is not None:
        load_planner(planner)  # known by its class, as the log names it
    logs = [Rollout.load(log_at(path)) for path in rollouts]
    shape: dict[str, Any] = {} if size is None else {"size": parse_size(size)}
    one_frame = at is not None or out.suffix.lower() == ".png"
    if len(logs) > 1 and one_frame:
        raise InputError(f"--out {out}: several rollouts need a film format")
    if one_frame:
        from antdrive.views.film.video import still

        still(logs[0], out, at, camera=camera, **shape)
        facts: dict[str, Any] = {"file": str(out), "frames": 1}
    else:
        facts = film_drives(logs, out, camera=camera, **shape, fps=fps, speed=speed, prelude=prelude)
    show(json, facts, file_lines({"film": facts["file"]}))
