"""The viewer in Chromium without a graphics card: first picture, checks, and frames per second among 400 cylinders and 24 movers.

    python -m benchmarks.viewer [PAGE]...

Without pages, it drives through such a world first.
"""

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from playwright.sync_api import sync_playwright

from antdrive.planners import PLANNERS
from antdrive.robots import load_robot
from antdrive.sim import Scenario, run
from antdrive.views.viewer.drive_page import write_page
from antdrive.worlds import Cruising, Disc, Task, World
from tools.site import opened

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


def main() -> None:
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        pages = [Path(word) for word in sys.argv[1:]]
        if not pages:
            drive = run(
                Scenario(task=crowded(), planner=PLANNERS["astar"], planner_name="astar", robot=load_robot("turtlebot"))
            )
            began = time.perf_counter()
            pages = [write_page([drive.logged], Path(folder) / "drive.html")]
            print(f"page of {drive.rollout.t[-1]:.1f} s written in {time.perf_counter() - began:.2f} s")
        browser = opened(playwright)
        print(
            "| page | kB | first picture [s] | checked [s] | frames/s: follow | whole | top |\n|---|---|---|---|---|---|---|"
        )
        for page in pages:
            tab = browser.new_page(viewport={"width": 1280, "height": 720})
            tab.goto(page.resolve().as_uri())
            tab.wait_for_selector("html[data-checked]", state="attached", timeout=120_000)
            painted, checked = (
                float(tab.get_attribute("html", f"data-{name}")) / 1000 for name in ("painted", "checked")
            )
            rates = []
            for camera in ("follow", "whole", "top"):
                tab.click(f'#cameras button[value="{camera}"]')
                tab.keyboard.press("Home")
                tab.evaluate(FRAMES, 1.0)  # shaders compile
                rates.append(f"{tab.evaluate(FRAMES, 4.0):.0f}")
            size = page.stat().st_size / 1000
            print(f"| {page.name} | {size:.0f} | {painted:.2f} | {checked:.2f} | {' | '.join(rates)} |")
        browser.close()


if __name__ == "__main__":
    main()
