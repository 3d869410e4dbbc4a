"""Generator of the pictures in `docs/pictures`: `python -m tools.pictures [NAME ...]`.

README and pages show these pictures without a build, so the repository holds them; each build of the site makes the gallery's
figures and films. Pictures of pages need playwright and Chromium. `FROM_PAPERS` are copies of the output of
`antdrive reproduce PAPER`, and `BY_HAND` are screenshots of other programs.
"""

from __future__ import annotations

import argparse
import functools
import itertools
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from antdrive.robots import list_robots
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.pipeline import Run, run
from antdrive.sim.scenario import Scenario
from antdrive.views.film.prelude import planning_frames
from antdrive.views.film.shot import Shot
from antdrive.views.film.video import STILLS, film, still
from antdrive.views.pages.report import write_report
from antdrive.views.viewer.drive_page import write_page
from antdrive.worlds import list_worlds, load_task
from antdrive.worlds.generators.generate import generated
from antdrive.worlds.trajectories import Trajectories
from antdrive.worlds.world import Disc, Task
from tools.pages import run_page

PICTURES = Path(__file__).resolve().parents[1] / "docs" / "pictures"
TUTORIALS = PICTURES.parent / "tutorials"
SIZE = (1120, 630)  # of most pictures [px]
SMALL = (640, 360)  # of pictures in tutorials [px]
FROM_PAPERS = ("hasan-maps.png", "ibraheem2016-history.png", "lee2008-maps.png")
BY_HAND = ("foxglove.webp",)
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
ARGUMENTS = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")  # of Chromium


def drive(world: str | Task, planner: str, **settings: Any) -> Rollout:
    """Drive a scenario and return its log."""
    log = run(Scenario.of(world, planner, **settings)).rollout
    assert log is not None
    return log


def saved(picture: Any, path: Path) -> None:
    """Write a picture (H, W, 3) with the settings of `still`."""
    from PIL import Image

    Image.fromarray(picture).save(path, format="webp", **STILLS[".webp"])


@functools.cache
def jackal() -> Run:
    """Drive the README's jackal without a map among movers."""
    settings = {"map": "none", "localisation": "matching", "noise": 1.0, "seed": 1}
    return run(Scenario.of("plaza-moving", "dstar-lite", robot="jackal", **settings))


def hero(path: Path) -> None:
    """Film a mapless drive among movers."""
    film(jackal().logged.rollout, path, camera="follow", size=(800, 450), fps=10, speed=1.2)


def view(path: Path) -> None:
    """Write the page of the same drive, drive.html, and take its picture."""
    screenshot(write_page([jackal().logged], path.with_name("drive.html")), path, (1280, 720), "html[data-checked]")


def screenshot(page: Path, path: Path, size: tuple[int, int], ready: str = "body") -> None:
    """Write a browser's picture of the upper part of a page."""
    from io import BytesIO

    from PIL import Image
    from playwright.sync_api import sync_playwright

    browser_path = next(filter(None, map(shutil.which, BROWSERS)), None)  # else playwright's own
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_path, args=ARGUMENTS)
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
    """Render a frame of every robot of the catalogue, one file each."""
    path.with_suffix("").mkdir(exist_ok=True)
    for name in list_robots():
        shot = Shot(drive("empty", "astar", robot=name), size=(640, 480), bare=True)
        saved(shot.view(0.0)[150:330, 210:430], path.with_suffix("") / f"{name}.webp")


def plaza(path: Path) -> None:
    """Render a robot among movers just after a replan."""
    log = drive("plaza-moving", "dstar-lite")
    replanned = next(replan.t for replan in log.record.replans if replan.t > 3.0)
    still(log, path, replanned + 0.3, camera="oblique", size=SIZE)


def unknown(path: Path) -> None:
    """Render a mapless robot's occupancy map."""
    log = drive("forest", "astar", robot="jackal", map="none", localisation="matching", noise=1.0, seed=1)
    still(log, path, 3.2, camera="oblique", size=(960, 540))


def pheromone(path: Path) -> None:
    """Render pheromone on the ground at iteration 30 of 100."""
    frames = planning_frames(drive("forest", "mmas"), {"camera": "oblique", "size": SIZE}, 100)
    saved(next(itertools.islice(frames, 29, None)), path)


def comparison(path: Path) -> None:
    """Render four planners in the same forest."""
    names = ("astar", "aco-han", "ants", "tangent")
    saved(Shot({name: drive("forest", name, smoothing="none") for name in names}, size=SIZE).frame(12.0), path)


def campaign(path: Path) -> None:
    """Render both planners of the tutorial's campaign in its first world."""
    task = generated("forest", 0, ())
    planners: list[tuple[str, Mapping[str, Any]]] = [("astar", {}), ("aco-han", {"ants": 20})]
    logs = {name: drive(task, name, options=options, smoothing="none") for name, options in planners}
    saved(Shot(logs, size=SMALL).frame(8.0), path)


def report(path: Path) -> None:
    """Take a browser's screenshot of the upper part of a report of six runs."""
    scenarios = [
        Scenario.of("plaza-moving", "dstar-lite"),
        Scenario.of("empty", "astar", unseen=(Disc(3.0, 3.0, 0.2),)),
        Scenario.of("forest", "aco-han"),
        Scenario.of("forest", "ants"),
        Scenario.of("forest", "astar", smoothing="none"),
        Scenario.of("no-path", "astar"),
    ]
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "report.html"
        write_report(map(run, scenarios), page, title="Ants against searches")
        screenshot(page, path, (1400, 1060))


@functools.cache
def lesson(page: str) -> Mapping[str, Rollout]:
    """Run a tutorial. Return its logs by folder."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            run_page(TUTORIALS / f"{page}.md")
            logs = sorted(Path().rglob("rollout.npz"))
            return {log.parent.relative_to("out").as_posix(): Rollout.load(log) for log in logs}
        finally:
            os.chdir(before)


def tutorial(path: Path, page: str, logs: list[str], t: float, camera: str = "oblique") -> None:
    """Render one log of a tutorial, or two in one picture, at a time [s]."""
    chosen = {name.rpartition("/")[2]: lesson(page)[name] for name in logs}
    shown = chosen if len(chosen) > 1 else chosen[logs[0].rpartition("/")[2]]
    saved(Shot(shown, camera=camera, size=SMALL).frame(t), path)


#: Page, logs, time [s] and camera of each picture of a tutorial.
LESSONS: Mapping[str, tuple[Any, ...]] = MappingProxyType({
    "first-drive": ("first-drive", ["first"], 9.0),
    "collision": ("first-drive", ["hit"], 3.9),
    "two-posts": ("your-own-world", ["two-posts"], 3.5),
    "long-robot": ("your-own-robot", ["long"], 8.0),
    "own-planner": ("your-own-planner", ["wave", "straight"], 9.0),
    "crossing": ("moving-world", ["crossing"], 6.0),
    "crossing-blind": ("moving-world", ["blind"], 5.4),
    "crossing-sipp": ("moving-world", ["sipp"], 6.0),
    "without-a-map": ("without-a-map", ["unknown"], 5.0),
    "drift": ("without-a-map", ["drift"], 12.0),
    "why-slow": ("why-slow", ["slow"], 5.0),
    "corners": ("why-slow", ["corners"], 5.0),
    "slower": ("regression-test", ["my/slalom-0"], 12.0),
    "slide": ("film-for-a-talk", ["ants"], 10.0),
    "side-by-side": ("film-for-a-talk", ["compare-slalom/astar", "compare-slalom/aco-han"], 10.0),
})  # fmt: skip
DRAWN = (hero, view, worlds, robots, plaza, unknown, pheromone, comparison, campaign, report)
#: Generator of each picture, by file name.
MADE: Mapping[str, Callable[[Path], None]] = MappingProxyType({
    **{made.__name__: made for made in DRAWN},
    **{name: functools.partial(tutorial, page=page, logs=logs, t=t) for name, (page, logs, t) in LESSONS.items()},
})  # fmt: skip


def main(words: list[str]) -> int:
    """Make the named pictures, or all."""
    asked = argparse.ArgumentParser(prog="python -m tools.pictures", description="Make the pictures of pages.")
    asked.add_argument("names", nargs="*", metavar="NAME", help=f"some of {', '.join(MADE)}; all by default")
    given = asked.parse_args(words)
    unknown_names = set(given.names) - set(MADE)
    if unknown_names:
        asked.error(f"{min(unknown_names)}: no such picture; choose from {', '.join(MADE)}")
    for name in given.names or MADE:
        MADE[name](PICTURES / f"{name}.webp")
        sys.stdout.write(f"docs/pictures/{name}.webp\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
