"""Page of one to four drives: their packed logs, what the page states about each, and the viewer that reads them.

The viewer takes every number from the log and recomputes distances, bound and digest; only the values of `stated` come from
here, and `antdrive verify` compares them with the log. `assets/reader.js` reads logs, `geometry.js` measures, `drive.js` answers
questions, `gl.js` and `scene.js` draw, `scrubber.js` is the curve, and `page.js` connects them.
"""

from __future__ import annotations

import html
import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from string import Template
from typing import Any

from antdrive.base.atomic import write_text
from antdrive.base.errors import InputError
from antdrive.base.version import __version__
from antdrive.sim.facts import LoggedRun
from antdrive.sim.log.packing import END, LINE, MARK
from antdrive.sim.log.record import finite_or_none
from antdrive.sim.log.rollout import Rollout
from antdrive.views.colours import LIMITER_COLOURS, label_styles

MOST_DRIVES = 4
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
    drives: Sequence[LoggedRun], path: Path, labels: Sequence[str] | None = None, *, baseline: Rollout | None = None
) -> Path:
    """Write the page of one to four drives in one world, atomically.

    Args:
        drives: the logs with their certificates
        path: the page to write
        labels: names of the drives; default: their planners
        baseline: a last drive that is the line of a baseline alone, without a certificate

    Raises:
        InputError: there are too many drives, their worlds differ, or the file cannot be written.
    """
    if not 1 <= len(drives) <= MOST_DRIVES:
        raise InputError(f"a page holds 1 to {MOST_DRIVES} drives, got {len(drives)}; name fewer")
    first = drives[0].record
    for drive in drives[1:]:
        world, wanted = drive.record.task.world, first.task.world
        if (world.bounds, world.obstacles) != (wanted.bounds, wanted.obstacles):
            raise InputError(f"drives in {wanted.name} and {world.name}: a page shows drives of one world")
    planners = [drive.record.planner.name for drive in drives]
    names = list(labels or planners)
    contents = [(drive.rollout, stated(drive)) for drive in drives]
    if baseline is not None:
        contents.append((baseline, _line(baseline)))
        names, planners = [*names, "baseline"], [*planners, "baseline"]
    logs = [
        rollout.packed(about | {"label": name, "colours": [style.light, style.dark]})
        for (rollout, about), name, style in zip(contents, names, label_styles(names, planners), strict=True)
    ]
    about = f"{first.task.world.name} · {' and '.join(names)} · {first.robot.name} · seed {first.seed}"
    plain = "; ".join(f"{drive.record.outcome.value}; {drive.certificate.sentence}." for drive in drives)
    content = Template((ASSETS / "page.html").read_text(encoding="utf-8")).substitute(
        version=__version__,
        title=html.escape(f"{' and '.join(names)} in {first.task.world.name}"),
        about=html.escape(about),
        plain=html.escape(plain),
        style=(ASSETS / "page.css").read_text(encoding="utf-8"),
        drives="\n".join(
            f"{(MARK if k < len(drives) else LINE).decode()}{log}{END.decode()}" for k, log in enumerate(logs)
        ),
        script=script(),
    )
    write_text(path, content)
    return path


def _line(baseline: Rollout) -> dict[str, Any]:
    """Return what a page states about a baseline: it is a line, and nothing is proved about it."""
    return {"line": True, "certificate": {"problems": []}, "command": "", "limiters": _limiters(baseline)}


def _limiters(rollout: Rollout) -> list[str]:
    return [LIMITER_COLOURS[k % len(LIMITER_COLOURS)] for k in range(max(1, len(rollout.record.limiters)))]


def stated(drive: LoggedRun) -> dict[str, Any]:
    """Return what a page states about a drive."""
    from antdrive.sim.recorded import command_in

    record, rollout = drive.record, drive.rollout
    seen: dict[str, Any] = {}
    if len(rollout.scans):
        from antdrive.sim.log.sights import first_meetings, mover_sightings

        movers = [sight.seen_at for sight in mover_sightings(rollout)] if record.world.movers else []
        seen = {"seen": [finite_or_none(at) for at in [*first_meetings(rollout).tolist(), *movers]]}
    return {
        "digest": rollout.digest,
        "certificate": drive.certificate.as_dict(),
        "command": command_in(record),
        "limiters": _limiters(rollout),
        **seen,
    }
