"""Page of one to four drives: their packed logs, what the page states about each, and the viewer that reads them.

The viewer takes every number from the log and recomputes distances, bound and digest; only the values of `stated` come from
here, and `antdrive verify` compares them with the log. The page of another program's log states what is proved, as assumed.
`assets/reader.js` reads logs, `geometry.js` measures, `drive.js` answers questions, `gl.js` and `scene.js` draw, `scrubber.js`
is the curve, and `page.js` connects them.
"""

from __future__ import annotations

import html
import math
import re
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from antdrive.base.atomic import write_text
from antdrive.base.errors import InputError
from antdrive.base.version import __version__
from antdrive.foreign.playback import ForeignRollout
from antdrive.sim.facts import LoggedRun, Run
from antdrive.sim.log.certificate import at_least
from antdrive.sim.log.packing import END, LINE, MARK
from antdrive.sim.log.rollout import Rollout
from antdrive.views.colours import LIMITER_COLOURS, field_name, label_styles, shown_field

MOST_DRIVES = 4
MOST_CELLS, LEVELS = 250_000, 50  # of a planner's field
MODULES = ("reader", "geometry", "drive", "gl", "scene", "scrubber", "page")
ASSETS = Path(__file__).with_name("assets")
#: Parts of JavaScript: texts and patterns, which stay, comments and blanks that mean nothing.
TEXTS, COMMENTS = r"""(`[^`]*`|"[^"\n]*"|/[^/\s*][^/\n]*/[gi]\b)""", r"//.*|\n\s*(?=\n|$)|(?<=\n)[ \t]+"
SIGNS = r"[=*/%<>!&|?:;,(){}\[\]]"
PARTS = re.compile(f"{TEXTS}|{COMMENTS}|[ ]*({SIGNS})[ ]+|[ ]+(?={SIGNS})")


@cache
def script() -> str:
    """Return the viewer's modules as one, without comments and blanks."""
    return minified("".join((ASSETS / f"{name}.js").read_text(encoding="utf-8") for name in MODULES))


def minified(text: str) -> str:
    """Return JavaScript without comments and needless blanks; names and lines stay."""
    return PARTS.sub(lambda part: part[1] or part[2] or "", text)


def write_page(
    drives: Sequence[LoggedRun | Run],
    path: Path,
    labels: Sequence[str] | None = None,
    *,
    baseline: Rollout | None = None,
    faults: Sequence[str] = (),
) -> Path:
    """Write the page of one to four drives in one world, atomically.

    Args:
        drives: logs with their certificates, or runs with a log, whose planner's field such as pheromone is shown, too
        path: the page to write
        labels: names of the drives; default: their planners
        baseline: a last drive that is the line of a baseline alone, without a certificate
        faults: why the drive fails its test

    Raises:
        InputError: there are too many drives, their worlds differ, or the file cannot be written.
    """
    if not 1 <= len(drives) <= MOST_DRIVES:
        raise InputError(f"a page holds 1 to {MOST_DRIVES} drives, got {len(drives)}; name fewer")
    if path.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"{path}: the name of a page ends in .html")
    contents = []
    for drive in drives:
        logged = drive.logged if isinstance(drive, Run) else drive
        assert logged is not None, "a page needs a log"
        about = {**stated(logged), "faults": [*faults], **(field_of(drive) if isinstance(drive, Run) else {})}
        contents.append((logged.rollout, about))
    world = contents[0][0].record.task.world
    for other in (rollout.record.task.world for rollout, _ in contents[1:]):
        if (other.bounds, other.obstacles) != (world.bounds, world.obstacles):
            raise InputError(f"drives in {world.name} and {other.name}: a page shows drives of one world")
    planners = [rollout.record.planner.name for rollout, _ in contents]
    names, plain = list(labels or planners), "; ".join(f"{about['plain']}." for _, about in contents)
    if baseline is not None:
        contents.append((baseline, _line(baseline)))
        names, planners = [*names, "baseline"], [*planners, "baseline"]
    logs = []
    for (rollout, about), name, style in zip(contents, names, label_styles(names, planners), strict=True):
        log = rollout.packed(about | {"label": name, "colours": [style.light, style.dark]})
        logs.append(f"{(LINE if about.get('line') else MARK).decode()}{log}{END.decode()}")
    content = Template((ASSETS / "page.html").read_text(encoding="utf-8")).substitute(
        version=__version__,
        title=html.escape(f"{' and '.join(names)} in {world.name}"),
        plain=html.escape(plain),
        style=(ASSETS / "page.css").read_text(encoding="utf-8"),
        drives="\n".join(logs),
        script=script(),
    )
    write_text(path, content)
    return path


def write_view(rollouts: Rollout | Mapping[str, Rollout], path: str | Path) -> Path:
    """Write the page of a run, or of up to four runs in one world, with its replay and proof.

    Args:
        rollouts: the run's log, or the logs by name
        path: the page to write, such as drive.html

    Raises:
        InputError: there are too many runs, their worlds differ, or the file cannot be written.
    """
    named = None if isinstance(rollouts, Rollout) else list(rollouts)
    logs = [rollouts] if isinstance(rollouts, Rollout) else rollouts.values()
    return write_page([LoggedRun.of(log) for log in logs], Path(path), named)


def _line(baseline: Rollout) -> dict[str, Any]:
    """Return what a page states about a baseline: it is a line, and nothing is proved about it."""
    about: dict[str, Any] = {"line": True, "proof": "none: this is the accepted drive's line alone", "command": ""}
    return about | {"certificate": {"problems": []}, "limiters": _limiters(baseline)}


def _claimed(log: ForeignRollout) -> dict[str, Any]:
    """Return what a page states about another program's log: what is proved, and what that assumes."""
    found = log.certificate
    least, most = at_least(found.bound), at_least(found.most_error)
    claim = f"{found.claim}: never closer than {least}" if found.certified else found.sentence
    return {
        "line": True,
        "claim": ["✓" if found.certified else "✕" if found.touched else "!", claim[0].upper() + claim[1:]],
        "about": f"world {found.world.name} · robot {found.robot.name} · log {found.log.source['file']}",
        "proof": "by the log; this page shows it",
        "notes": [
            *(f"assumed: {one}" for one in found.assumptions),
            *[f"clear for all pose errors below {most}"] * found.certified,
            *found.log.findings,
        ],
        "certificate": {"certified": found.certified, "bound_m": found.as_dict()["bound_m"]},
        "plain": found.sentence,
        "command": "",
        "limiters": [],
    }


def _limiters(rollout: Rollout) -> list[str]:
    return [LIMITER_COLOURS[k % len(LIMITER_COLOURS)] for k in range(max(1, len(rollout.record.limiters)))]


def stated(drive: LoggedRun) -> dict[str, Any]:
    """Return what a page states about a drive."""
    from antdrive.sim.recorded import command_in

    record, rollout = drive.record, drive.rollout
    if isinstance(rollout, ForeignRollout):
        return _claimed(rollout)
    seen: dict[str, Any] = {}
    if len(rollout.scans):
        from antdrive.sim.log.sights import seen_at  # imported here, because it loads kernels

        seen = {"seen": seen_at(rollout)}
    return {
        "digest": rollout.digest,
        "certificate": drive.certificate.as_dict(),
        "command": command_in(record),
        "limiters": _limiters(rollout),
        "plain": f"{record.outcome.value}; {drive.certificate.sentence}",
        **seen,
    }


def field_of(run: Run) -> dict[str, Any]:
    """Return the field of a run's planner, such as pheromone, in levels for a page; empty without one."""
    grid, plan, rollout = run.grid, run.plan, run.rollout
    found = None if plan.field is None else shown_field(grid, plan.field)
    if found is None or rollout is None or (rollout.record.sensing and rollout.record.sensing.map == "none"):
        return {}
    values, low, high = found
    step = math.ceil(math.sqrt(values.size / MOST_CELLS))
    values = np.nan_to_num(values[::step, ::step], nan=low)
    levels = np.clip((values - low) / (high - low), 0, 1) * LEVELS
    (rows, columns), half = values.shape, grid.cell / 2
    x, y = grid.origin[0] - half, grid.origin[1] - half
    return {
        "field": {
            "name": field_name(plan.work_unit),
            "bounds": [x, y, x + columns * step * grid.cell, y + rows * step * grid.cell],
            "rows": rows,
            "columns": columns,
            "values": (levels.round().astype(np.uint8) + 40).tobytes().decode(),
        }
    }
