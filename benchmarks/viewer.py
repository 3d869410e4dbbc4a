"""The viewer in Chromium without a graphics card: bytes, first picture, checks, and frames per second.

    python -m benchmarks.viewer [PAGE]... [--seconds 4]

Without pages it drives among 400 cylinders and 24 movers, across the plaza without a map, and through the office.
"""

import tempfile
import time
from pathlib import Path

import numpy as np

from antdrive.planners import PLANNERS
from antdrive.robots import load_robot
from antdrive.sim import Scenario, run
from antdrive.sim.facts import LoggedRun
from antdrive.sim.log.rollout import Rollout
from antdrive.views.viewer.drive_page import write_page
from antdrive.worlds import Cruising, Disc, Task, World
from benchmarks.markdown import command_line, missing
from tools.loop import loop
from tools.site import opened

SMALLEST = ("--seconds 0.2 --only plaza",)
#: Chromium's note on how it copies pictures where there is no graphics card; no page causes or avoids it.
OWN = "GL Driver Message"
SIZE, CYLINDERS, MOVERS = 40.0, 400, 24
#: Plays for some seconds and returns the frames per second.
FRAMES = """async (seconds) => {
  document.getElementById("play").click();
  const begin = performance.now();
  let frames = 0;
  await new Promise((done) => {
    const next = (now) => { frames++; now - begin < 1000 * seconds ? requestAnimationFrame(next) : done(); };
    requestAnimationFrame(next);
  });
  document.getElementById("play").click();
  return frames / seconds;
}"""


def crowded() -> Task:
    """Return a world of 400 cylinders and 24 movers beside and across an aisle."""
    rng, found = np.random.default_rng(1), []
    while len(found) < CYLINDERS:
        x, y, radius = rng.uniform(1, SIZE - 1), rng.uniform(1, SIZE - 1), rng.uniform(0.15, 0.4)
        apart = all(np.hypot(x - o.x, y - o.y) > radius + o.radius + 0.3 for o in found)
        if apart and abs(y - SIZE / 2) > 1.2:
            found.append(Disc(float(x), float(y), float(radius)))
    places = [(5 + 30 * k / MOVERS, float(rng.uniform(3, 15)), float(rng.uniform(0.2, 0.5))) for k in range(MOVERS)]
    movers = tuple(Cruising(radius=0.25, position=(x, y), velocity=(0.0, v)) for x, y, v in places)
    world = World("crowded", (0.0, 0.0, SIZE, SIZE), tuple(found), movers=movers)
    return Task(world, (2.0, SIZE / 2, 0.0), (30.0, SIZE / 2))


def drives(only: str) -> dict[str, Scenario]:
    """Return the scenarios whose names contain a word."""
    words = {"planner": PLANNERS["astar"], "planner_name": "astar", "robot": load_robot("turtlebot")}
    found = {
        "400 cylinders, 24 movers": Scenario(task=crowded(), **words),
        "plaza-moving, without a map": Scenario.of("plaza-moving", "astar", map="none"),
        "office, 1,100 cylinders": Scenario.of("office", "astar"),
    }
    return {name: scenario for name, scenario in found.items() if only in name}


def main() -> None:
    options = command_line(
        __doc__, page=([], "pages"), seconds=(4.0, "seconds of each camera"), only=("", "word in the names of drives")
    )
    try:
        from playwright.sync_api import Error, sync_playwright
    except ImportError:
        missing("playwright drives chromium: pip install playwright")
    pages = {Path(word).name: (Path(word), "–", "–") for word in options.page}
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        for k, (name, scenario) in enumerate(() if pages else drives(options.only).items()):
            log = run(scenario).rollout
            assert log is not None
            saved, began = log.save(Path(folder) / f"{k}.npz"), time.perf_counter()
            page = write_page([LoggedRun.of(Rollout.load(saved))], Path(folder) / f"{k}.html")
            pages[name] = page, f"{log.t[-1]:.1f}", f"{time.perf_counter() - began:.2f}"
        try:
            browser = opened(playwright)
        except Error as error:
            missing(str(error))
        print(
            "| page | drive [s] | kB | log to page [s] | first picture [s] | checked [s] | frames/s: follow | ride | whole | top "
            "| messages, requests |\n|---|---|---|---|---|---|---|---|---|---|---|"
        )
        for name, (page, seconds, written) in pages.items():
            heard: list[str] = []
            for _ in "cold", "warm":
                tab = browser.new_page(viewport={"width": 1280, "height": 720})
                tab.on("console", lambda note, heard=heard: None if OWN in note.text else heard.append(note.text))
                tab.on("request", lambda one, heard=heard: None if one.url[:5] == "file:" else heard.append(one.url))
                tab.goto(page.resolve().as_uri())
                tab.wait_for_selector("html[data-checked]", state="attached", timeout=120_000)
            painted, checked = (
                float(tab.get_attribute("html", f"data-{stage}")) / 1000 for stage in ("painted", "checked")
            )
            rates = []
            for camera in ("follow", "ride", "whole", "top"):
                tab.click(f'#cameras button[value="{camera}"]')
                tab.keyboard.press("Home")
                tab.evaluate(FRAMES, min(1.0, options.seconds))  # shaders compile
                rates.append(f"{tab.evaluate(FRAMES, options.seconds):.0f}")
            told = [
                name,
                seconds,
                f"{page.stat().st_size / 1000:.0f}",
                written,
                f"{painted:.2f}",
                f"{checked:.2f}",
                *rates,
            ]
            print("|", " | ".join([*told, str(len(heard))]), "|", flush=True)
            tab.close()
        browser.close()
    print(f"\nTen million additions take {loop():.2f} s.")


if __name__ == "__main__":
    main()
