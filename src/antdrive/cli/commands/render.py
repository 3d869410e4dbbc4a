"""`antdrive render`."""

from collections import Counter
from pathlib import Path
from typing import Annotated, Any

from antdrive.base.errors import InputError
from antdrive.base.tables import file_lines
from antdrive.cli import options
from antdrive.cli.console import show
from antdrive.cli.options import argument, option
from antdrive.cli.output import film_drives


@options.with_settings()
def render(
    *,
    rollouts: Annotated[list[Path], argument("ROLLOUT", "Logs or folders of runs; up to six share a picture.")],
    out: Annotated[Path, option("FILE", "Film (.mp4, .gif, .webp) or frame (.png).", panel="Output")],
    filming: options.Filming,
    fps: Annotated[int, option("NUMBER", "Frames per second.", panel="Output", min=1, max=240)] = 30,
    at: Annotated[
        float | None, option("SECONDS", "Write the frame at this time [s] (.png or .webp).", panel="Output", min=0.0)
    ] = None,
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
    one_frame = at is not None or out.suffix.lower() == ".png"
    if len(logs) > 1 and one_frame:
        raise InputError(f"--out {out}: several rollouts need a film format")
    if one_frame:
        from antdrive.views.film.film_options import STILLS
        from antdrive.views.film.video import still

        if out.suffix.lower() not in STILLS:
            raise InputError(f"--out {out}: --at writes a still, {' or '.join(STILLS)}")
        still(logs[0], out, at, **filming.shape())
        facts: dict[str, Any] = {"file": str(out), "frames": 1}
    else:
        planners = Counter(log.record.planner.name for log in logs)
        names = [log.record.planner.name for log in logs]
        names = [f"{name} {path}" if planners[name] > 1 else name for name, path in zip(names, rollouts, strict=True)]
        given = {"fps": fps, "speed": filming.speed, "prelude": filming.prelude}
        facts = film_drives(dict(zip(names, logs, strict=True)), out, **filming.shape(), **given)
    show(json, facts, file_lines({"film": facts["file"]}))
