"""Generator of the pictures in `docs/pictures`: `python -m tools.pictures [NAME ...]`.

README and pages show these pictures without a build, so the repository holds them. `drives.json` has digest and figures of
the drives that each shows; a slow test repeats them, so a stale picture fails. The build of the site runs the pages, writes
the page of each picture's drives (`write_pages`) and links it. Pictures of pages need playwright and Chromium. `FROM_PAPERS`
are copies of the output of `antdrive reproduce PAPER`, and `BY_HAND` are screenshots of other programs.
"""

from __future__ import annotations

import argparse
import functools
import itertools
import json
import os
import re
import sys
import tempfile
from collections.abc import Callable, Mapping
from io import BytesIO
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from antdrive.base.atomic import write_text
from antdrive.base.files import write_json
from antdrive.robots import list_robots, load_robot
from antdrive.robots.card import robot_svg
from antdrive.sim.facts import LoggedRun
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.pipeline import Run, run
from antdrive.sim.scenario import Scenario
from antdrive.views.film.film_options import STILLS
from antdrive.views.film.prelude import planning_frames
from antdrive.views.film.shot import Shot
from antdrive.views.film.video import film
from antdrive.views.pages.report import write_report
from antdrive.views.viewer.drive_page import write_page
from antdrive.worlds import list_worlds, load_task
from antdrive.worlds.generators.generate import generated
from antdrive.worlds.trajectories import Trajectories
from antdrive.worlds.world import Disc, Task
from tools.pages import run_page
from tools.site import SOFTWARE, opened

DOCS = Path(__file__).resolve().parents[1] / "docs"
PICTURES, DRIVES = DOCS / "pictures", DOCS / "pictures" / "drives.json"
SIZE = (800, 450)  # of pictures of drives [px]
LOOPS = 2  # times that the first page's film plays
FIGURES = ("duration_s", "driven_length_m", "min_clearance_m", "tracking_error_max_m")
FROM_PAPERS = ("hasan-maps.png", "ibraheem2016-history.png", "lee2008-maps.png")
BY_HAND = ("foxglove.webp",)
MAPLESS: Mapping[str, Any] = {"robot": "jackal", "map": "none", "localisation": "matching", "noise": 1.0, "seed": 1}
Logs: TypeAlias = Mapping[str, Rollout]


class Picture(NamedTuple):
    """Picture of drives."""

    logs: Callable[[], Logs]  # drives them
    draw: Callable[[Logs, Path], None]
    page: str = ""  # the page that shows it, if the site links the drives' own page
    folders: tuple[str, ...] = ()  # of the logs, if that page drives them


def drive(world: str | Task, planner: str, **settings: Any) -> Rollout:
    """Drive a scenario and return its log."""
    log = run(Scenario.of(world, planner, **settings)).rollout
    assert log is not None
    return log


def saved(picture: Any, path: Path) -> None:
    """Write a picture (H, W, 3) with the settings of `still`."""
    from PIL import Image

    Image.fromarray(picture).save(path, format="webp", **STILLS[".webp"])


def frame(logs: Logs, path: Path, t: float | None = None, **options: Any) -> None:
    """Render one drive, by the camera that follows, or several in one picture, at a time [s]; default: where it is closest."""
    first, *others = logs.values()
    at = float(first.t[np.argmin(first.clearance)]) if t is None else t
    saved(Shot(logs if others else first, size=SIZE, **options).frame(at), path)


@functools.cache
def jackal() -> Logs:
    """Drive the README's jackal without a map among movers."""
    return {"dstar-lite": drive("plaza-moving", "dstar-lite", **MAPLESS)}


def hero(logs: Logs, path: Path) -> None:
    """Film a mapless drive among movers. The film ends after `LOOPS` rounds."""
    film(logs["dstar-lite"], path, size=SIZE, fps=10, speed=1.4)
    data = bytearray(path.read_bytes())
    at = data.index(b"ANIM") + 12
    data[at : at + 2] = LOOPS.to_bytes(2, "little")
    path.write_bytes(data)


def view(logs: Logs, path: Path) -> None:
    """Write the page of the same drive, drive.html, and take its picture."""
    page = write_page([LoggedRun.of(log) for log in logs.values()], path.with_name("drive.html"))
    screenshot(page, path, (1280, 720), "html[data-checked]")


def screenshot(page: Path, path: Path, size: tuple[int, int], ready: str = "body") -> None:
    """Write a browser's picture of the upper part of a page."""
    from PIL import Image
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = opened(playwright, *SOFTWARE)
        tab = browser.new_page(viewport={"width": size[0], "height": size[1]}, bypass_csp=True)
        tab.goto(page.as_uri())
        tab.wait_for_selector(ready, state="attached")
        tab.wait_for_timeout(500)
        taken = tab.screenshot()
        browser.close()
    with Image.open(BytesIO(taken)) as picture:
        picture.convert("RGB").save(path, format="webp", **STILLS[".webp"])


def worlds(path: Path) -> None:
    """Draw a top view of every world of the catalogue, one file each."""
    from matplotlib.collections import PatchCollection
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle

    for name in list_worlds():
        task = load_task(name)
        (x0, y0, x1, y1), (width, height) = task.world.bounds, task.world.size
        figure = Figure(figsize=(1.6, 1.6 * height / width), dpi=100)
        axes = figure.add_axes((0.01, 0.01, 0.98, 0.98), xlim=(x0, x1), ylim=(y0, y1), xticks=[], yticks=[])
        discs = [Circle((disc.x, disc.y), disc.radius) for disc in task.world.obstacles]
        axes.add_collection(PatchCollection(discs, facecolor="#5a6577"))
        movers = Trajectories.of(task.world, task.start[:2])
        for place, radius in zip(movers.positions(0.0)[0], movers.radii, strict=True):
            axes.add_patch(Circle(place, radius, facecolor="#d9a128"))
        axes.plot(*task.start[:2], "o", color="#f26b0f", ms=4)
        axes.plot(*task.goal, "*", color="#0b8a6a", ms=6)
        path.with_suffix("").mkdir(exist_ok=True)
        figure.savefig(path.with_suffix("") / f"{name}.webp", facecolor="white")


def robots(path: Path) -> None:
    """Draw the footprint of every robot of the catalogue at one scale, one file each."""
    path.with_suffix("").mkdir(exist_ok=True)
    for name in list_robots():
        robot = load_robot(name)
        xmin, ymin, xmax, ymax = robot.footprint.bounds
        drawn = robot_svg(robot.footprint, robot.wheel_radius, robot.track, robot.wheel_thickness)
        x, y = 500 * (xmin + xmax) - 600, -500 * (ymin + ymax) - 400
        lines = [
            f'<svg xmlns="http://www.w3.org/2000/svg" width="156" height="117" viewBox="{x:g} {y:g} 1200 900">',
            "<style>.footprint, .heading { stroke-width: 10 }</style>",
            f'<rect x="{x:g}" y="{y:g}" width="1200" height="900" fill="white"/>',
            re.sub('<path class="ruler".*?/>', "", re.findall("<g .*</g>", drawn)[0]),
            f'<path d="M {x + 350:g} {y + 770:g} h 500 m -500 -20 v 40 m 500 0 v -40" stroke="#5b6576" stroke-width="8"/>',
            f'<text x="{x + 600:g}" y="{y + 870:g}" font-size="85" text-anchor="middle" font-family="sans-serif">0.5 m</text>',
        ]
        (path.with_suffix("") / f"{name}.svg").write_text("\n".join([*lines, "</svg>", ""]), encoding="utf-8")


def plaza() -> Logs:
    """Drive among movers with a map."""
    return {"dstar-lite": drive("plaza-moving", "dstar-lite")}


def unknown() -> Logs:
    """Drive a forest without a map."""
    return {"astar": drive("forest", "astar", **MAPLESS)}


def pheromone(logs: Logs, path: Path) -> None:
    """Render pheromone on the ground at iteration 5 of 100."""
    (log,) = logs.values()
    frames = planning_frames(log, {"camera": "oblique", "size": (960, 540)}, 100)
    saved(next(itertools.islice(frames, 4, None)), path)


def four() -> Logs:
    """Drive the plans of four planners in the same forest."""
    return {name: drive("forest", name, smoothing="none") for name in ("astar", "aco-han", "ants", "tangent")}


def campaign() -> Logs:
    """Drive the plans of both planners of the tutorial's campaign in its first world."""
    task = generated("forest", 0, ())
    planners: list[tuple[str, Mapping[str, Any]]] = [("astar", {}), ("aco-han", {"ants": 20})]
    return {name: drive(task, name, options=options, smoothing="none") for name, options in planners}


@functools.cache
def reported() -> list[Run]:
    """Drive what the report shows."""
    scenarios = [
        Scenario.of("plaza-moving", "dstar-lite"),
        Scenario.of("empty", "astar", unseen=(Disc(3.0, 3.0, 0.2),)),
        Scenario.of("forest", "aco-han"),
        Scenario.of("forest", "ants"),
        Scenario.of("forest", "astar", smoothing="none"),
        Scenario.of("no-path", "astar"),
    ]
    return [run(scenario) for scenario in scenarios]


def driven() -> Logs:
    """Return the logs of the report."""
    return {
        f"{one.scenario.task.world.name} {one.scenario.planner_name}": one.rollout for one in reported() if one.rollout
    }


def report(_: Logs, path: Path) -> None:
    """Take a browser's screenshot of the upper part of a report of six runs."""
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "report.html"
        write_report(reported(), page, title="Ants against searches")
        screenshot(page, path, (1280, 720))


@functools.cache
def logs_of(page: str) -> Logs:
    """Run a page. Return its logs by folder."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            run_page(DOCS / f"{page}.md")
            return {log.parent.relative_to("out").as_posix(): Rollout.load(log) for log in Path().rglob("rollout.npz")}
        finally:
            os.chdir(before)


def lesson(page: str, *folders: str, t: float | None = None, **options: Any) -> Picture:
    """Return a picture of drives of a page."""

    def logs() -> Logs:
        return {name.rpartition("/")[2]: logs_of(page)[name] for name in folders}

    return Picture(logs, functools.partial(frame, t=t, **options), page, folders)


#: Pictures of drives by file name.
SHOWN: Mapping[str, Picture] = MappingProxyType({
    "hero": Picture(jackal, hero),
    "view": Picture(jackal, view),
    "plaza": Picture(plaza, frame, "how-to/movers"),
    "unknown": Picture(unknown, functools.partial(frame, t=3.2), "explanation/unknown-worlds"),
    "pheromone": lesson("tutorials/film-for-a-talk", "ants")._replace(draw=pheromone),
    "comparison": Picture(four, functools.partial(frame, t=12.0), "how-to/pictures"),
    "campaign": Picture(campaign, functools.partial(frame, t=8.0), "tutorials/compare-planners"),
    "report": Picture(driven, report),
    "first-drive": lesson("tutorials/first-drive", "first"),
    "collision": lesson("tutorials/first-drive", "hit"),
    "two-posts": lesson("tutorials/your-own-world", "two-posts"),
    "long-robot": lesson("tutorials/your-own-robot", "long", t=8.0),
    "own-planner": lesson("tutorials/your-own-planner", "wave", "straight", t=9.0),
    "own-controller": lesson("tutorials/your-own-controller", "mine", t=5.0),
    "own-ants": lesson("tutorials/your-own-ants", "keen-drive", t=16.0),
    "crossing": lesson("tutorials/moving-world", "crossing"),
    "crossing-blind": lesson("tutorials/moving-world", "blind", t=5.4),
    "crossing-sipp": lesson("tutorials/moving-world", "sipp"),
    "without-a-map": lesson("tutorials/without-a-map", "unknown", t=5.0),
    "drift": lesson("tutorials/without-a-map", "drift", t=12.0),
    "why-slow": lesson("tutorials/why-slow", "slow"),
    "corners": lesson("tutorials/why-slow", "corners"),
    "slower": lesson("tutorials/regression-test", "my/slalom-0"),
    "slide": lesson("tutorials/film-for-a-talk", "ants", t=10.0),
    "side-by-side": lesson("tutorials/film-for-a-talk", "compare-slalom/astar", "compare-slalom/aco-han", t=10.0),
})  # fmt: skip
#: Generators of the other pictures, which show no drives' figures.
DRAWN: Mapping[str, Callable[[Path], None]] = MappingProxyType({"worlds": worlds, "robots": robots})


def figures_of(log: Rollout) -> dict[str, Any]:
    """Return digest and figures of a drive, by which a picture is known to be stale."""
    one = LoggedRun.of(log)
    numbers = {name: one.metrics[name] for name in FIGURES} | {"bound_m": one.certificate.bound}
    return {"digest": log.digest, "outcome": log.outcome.key, **{name: round(n, 4) for name, n in numbers.items()}}


def entry_of(name: str, logs: Logs) -> dict[str, Any]:
    """Return the entry of a picture in `drives.json`."""
    page = {"page": SHOWN[name].page} if SHOWN[name].page else {}
    return {**page, "drives": {label: figures_of(log) for label, log in logs.items()}}


def write_pages(page: str, folder: Path) -> None:
    """Write the page of the drives of each picture that a page shows; the working directory has that page's logs."""
    for name, shown in SHOWN.items():
        if shown.page != page:
            continue
        own = [Path("out") / one / "drive.html" for one in shown.folders]
        if len(own) == 1 and own[0].exists():
            write_text(folder / f"{name}.html", own[0].read_text(encoding="utf-8"))
        elif all(one.with_name("rollout.npz").exists() for one in own):
            logs = {one.parent.name: Rollout.load(one.with_name("rollout.npz")) for one in own} or shown.logs()
            write_page([LoggedRun.of(log) for log in logs.values()], folder / f"{name}.html", list(logs))


def main(words: list[str]) -> int:
    """Make the named pictures, or all."""
    names = [*SHOWN, *DRAWN]
    asked = argparse.ArgumentParser(prog="python -m tools.pictures", description="Make the pictures of pages.")
    asked.add_argument("names", nargs="*", metavar="NAME", help=f"some of {', '.join(names)}; all by default")
    given = asked.parse_args(words)
    if unknown_names := set(given.names) - set(names):
        asked.error(f"{min(unknown_names)}: no such picture; choose from {', '.join(names)}")
    for name in given.names or names:
        path = PICTURES / f"{name}.webp"
        if name in DRAWN:
            DRAWN[name](path)
        else:
            logs = SHOWN[name].logs()
            SHOWN[name].draw(logs, path)
            entries = json.loads(DRIVES.read_text()) | {name: entry_of(name, logs)}
            write_json(DRIVES, {one: entries[one] for one in SHOWN if one in entries})
        sys.stdout.write(f"docs/pictures/{name}.webp\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
