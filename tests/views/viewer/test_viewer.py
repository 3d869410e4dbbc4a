"""The viewer in Chromium: it shows what the log says, by mouse, finger and keyboard, and asks no host for anything."""

import math
import random
import re
from dataclasses import replace

import numpy as np
import pytest

from antdrive.foreign.playback import foreign_run
from antdrive.foreign.setup import ForeignSetup
from antdrive.runs.suites.baseline import Baseline
from antdrive.sim.facts import LoggedRun
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.log.sights import first_meetings
from antdrive.views.artefacts import baseline_rollout
from antdrive.views.viewer.drive_page import write_page
from tests.changed_page import changed
from tests.foreign.test_certificate import here, table
from tests.made_up_drive import scanned
from tests.views.pages.browser import needs_browser
from tools.site import SOFTWARE
from tools.site import opened as launched

pytestmark = needs_browser
__all__ = ["here"]
#: The number of different colours at some places of the scene.
COLOURS = """() => {
  const gl = document.getElementById("scene").getContext("webgl2"), found = new Set(), one = new Uint8Array(4);
  for (let k = 0; k < 400; k++) {
    gl.readPixels((37 * k) % gl.drawingBufferWidth, (53 * k) % gl.drawingBufferHeight, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, one);
    found.add(one.join());
  }
  return found.size;
}"""
SIZES = {"desk": {"width": 1280, "height": 720}, "phone": {"width": 390, "height": 844}}


@pytest.fixture(scope="module")
def chromium():
    api = pytest.importorskip("playwright.sync_api", reason="playwright drives chromium: pip install playwright")
    with api.sync_playwright() as playwright:
        browser = launched(playwright, *SOFTWARE)
        yield browser
        browser.close()


@pytest.fixture
def opened(chromium):
    """Open a page and wait until it has checked its log. At the end it must have said and asked for nothing.

    Playwright waits by `eval`, which the page's policy forbids.
    """
    heard, contexts = [], []

    def call(path, *, hash="", size="desk", bypass_csp=True, **options):
        contexts.append(chromium.new_context(viewport=SIZES[size], bypass_csp=bypass_csp, **options))
        tab = contexts[-1].new_page()
        tab.on("console", lambda message: heard.append(message.text))
        tab.on("pageerror", lambda error: heard.append(str(error)))
        tab.on("request", lambda request: heard.append(request.url) if request.url[:5] != "file:" else None)
        tab.goto(path.as_uri() + hash)
        tab.wait_for_selector("html[data-checked]", state="attached", timeout=60_000)
        return tab

    yield call
    for context in contexts:
        context.close()
    assert heard == []


@pytest.fixture(scope="module")
def page(small_run, tmp_path_factory):
    return write_page([small_run.logged], tmp_path_factory.mktemp("page") / "drive.html")


@pytest.fixture(scope="module")
def mapless(made_up_drive, tmp_path_factory):
    """A mapless drive with scans and movers, and its page."""
    log = scanned(made_up_drive(seconds=3.0, movers=2))
    return log, write_page([LoggedRun.of(log)], tmp_path_factory.mktemp("mapless") / "drive.html")


def drawn(tab):
    """Wait until the page has drawn what it was last told."""
    tab.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def text(tab, name):
    drawn(tab)
    return tab.inner_text(f"#{name}")


def go(tab, hash):
    tab.evaluate("(hash) => { location.hash = hash }", hash)
    tab.wait_for_function(
        "(t) => document.getElementById('curve').getAttribute('aria-valuenow') === t", arg=f"{float(hash[3:]):.2f}"
    )


def test_the_first_screen_is_the_closest_moment(opened, page, small_run):
    tab, log, certificate = opened(page), small_run.rollout, small_run.certificate
    row = int(log.clearance.argmin())
    proved = f"{math.floor(certificate.bound * 1000) / 1000:.3f}"
    assert text(tab, "verdict") == f"✓ Reached the goal. Never closer than {proved} m (proved)."
    assert text(tab, "about") == "world small · planner astar · robot turtlebot · seed 0"
    assert text(tab, "clock") == f"{log.t[row]:.2f} s"
    assert text(tab, "distance") == f"{log.clearance[row]:.3f} m"
    assert f"obstacle 0 at {log.t[row]:.1f} s" in text(tab, "closest")
    assert text(tab, "command").startswith("antdrive run ") or text(tab, "command") == ""
    assert tab.get_attribute("#play", "aria-label") == "Play"
    assert not tab.is_visible("#parts")


@pytest.mark.parametrize("which", ["small", "mapless"])
def test_numbers_at_twenty_moments_are_those_of_the_log(opened, page, small_run, mapless, which):
    log, path = (small_run.rollout, page) if which == "small" else mapless
    tab, hz = opened(path), log.record.physics_hz
    for row in random.Random(4).sample(range(len(log.t)), 20):
        go(tab, f"#t={row / hz:.6f}")
        assert float(text(tab, "clock")[:-2]) == pytest.approx(log.t[row], abs=0.00501)
        assert text(tab, "clearance").split(" m to ")[0] == text(tab, "distance")[:-2] == f"{log.clearance[row]:.3f}"
        speed, top = re.fullmatch(r"(.+) of (.+) m/s", text(tab, "speed")).groups()
        assert float(speed) == pytest.approx(abs(log.twist[row, 0]), abs=0.00501)
        assert top == f"{log.record.robot.max_speed:.3g}"


def test_the_page_recomputes_the_digest(opened, page, small_run):
    tab = opened(page, bypass_csp=False)
    assert re.sub(r"\s+", " ", text(tab, "proof")) == "Proof digest recomputed ✓ physics ✓ geometry ✓ bound ✓"
    assert tab.get_attribute("#proof", "title").endswith(small_run.rollout.digest)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda arrays, *_: np.add(arrays["pose"], [1e-12, 0, 0], out=arrays["pose"]), "digest"),
        (lambda _, record, __: record.update(seed=8), "digest"),
        (lambda _, __, stated: stated["certificate"].update(bound_m=0.5), "bound"),
        (lambda _, __, stated: stated["certificate"].update(min_clearance_m=0.5), "geometry"),
    ],
)
def test_a_changed_page_says_so(opened, page, tmp_path, change, named):
    other = tmp_path / "changed.html"
    other.write_bytes(page.read_bytes())
    changed(other, change)
    tab = opened(other)
    assert text(tab, "verdict").startswith("✕ Do not trust this page")
    assert named in text(tab, "verdict")


def test_a_collision_is_told_at_its_first_contact(opened, collided_run, tmp_path):
    tab, log = opened(write_page([collided_run.logged], tmp_path / "drive.html")), collided_run.rollout
    first = log.t[log.first_contact]
    assert text(tab, "verdict") == f"✕ Touched obstacle 1 (placed after planning) at {first:.1f} s."
    assert text(tab, "clock") == f"{first:.2f} s"
    assert "physics ✕" in text(tab, "proof")
    assert "contact points" in text(tab, "problems")


def test_the_keyboard_reaches_everything(opened, page, small_run):
    tab, end = opened(page, size="phone"), float(small_run.rollout.t[-1])
    clock = lambda: float(text(tab, "clock")[:-2])  # noqa: E731
    tab.keyboard.press("Home")
    tab.wait_for_function("document.getElementById('clock').textContent === '0.00 s'")
    tab.keyboard.press("ArrowRight")
    tab.keyboard.press("Shift+ArrowRight")
    drawn(tab)
    assert clock() == pytest.approx(1.1, abs=0.01)
    tab.keyboard.press("End")
    drawn(tab)
    assert clock() == pytest.approx(end, abs=0.01)
    tab.keyboard.press("c")
    tab.keyboard.press(" ")
    tab.wait_for_timeout(600)
    assert tab.get_attribute("#play", "aria-label") == "Pause"
    tab.keyboard.press(" ")
    assert 0 < clock() < end
    tab.wait_for_function("location.hash.endsWith('cam=ride')")
    seen = set()
    for _ in range(30):
        tab.keyboard.press("Tab")
        seen.add(tab.evaluate("document.activeElement.id || document.activeElement.value"))
        outline = tab.evaluate("getComputedStyle(document.activeElement).outlineStyle")
        assert outline != "none" or tab.evaluate("document.activeElement === document.body")
    assert {
        "follow",
        "ride",
        "whole",
        "top",
        "curve",
        "play",
        "pace",
        "link",
        "closest",
        "slowest",
        "proof",
        "bodies",
        "copy",
    } <= seen


def test_the_moment_is_told_in_words(opened, page):
    tab = opened(page, hash="#t=1&cam=top")
    tab.wait_for_function("document.getElementById('words').textContent !== ''")
    told = r"At 1\.00 seconds: \d\.\d{3} m to .+; speed \d\.\d\d of 0\.7 m/s, limited by .+\."
    assert re.fullmatch(told, tab.text_content("#words"))
    assert tab.evaluate("location.hash") == "#t=1.000&cam=top"


def test_an_obstacle_answers_a_click_and_the_list(opened, mapless):
    log, path = mapless
    tab = opened(path)
    tab.select_option("#bodies", "3")
    away = np.hypot(*(log.pose[:, :2] - log.record.world.discs[3, :2]).T) - log.record.world.discs[3, 2] - 0.18
    assert f"nearest {away.min():.3f} m" in text(tab, "about-body")
    tab.click("#about-body button")
    drawn(tab)
    assert text(tab, "clock") == f"{log.t[away.argmin()]:.2f} s"
    assert "first seen" in text(tab, "about-body")
    tab.click('#cameras button[value="top"]')
    drawn(tab)
    x, y, _ = log.record.world.discs[5]
    box = tab.locator("#scene").bounding_box()
    width, height = log.record.world.bounds[2:]
    scale = min(box["height"] / height, box["width"] / width) / 1.12
    tab.mouse.click(
        box["x"] + box["width"] / 2 + (x - width / 2) * scale, box["y"] + box["height"] / 2 - (y - height / 2) * scale
    )
    assert text(tab, "about-body").startswith("obstacle 5 ")


def test_a_reader_finds_six_answers_in_the_page_alone(opened, mapless):
    """Where was it closest, when did it first see obstacle 12, why slow at 2 s, did it touch, which planner, is it proved?"""
    log, path = mapless
    tab, row = opened(path, size="phone"), int(log.clearance.argmin())
    assert f"at {log.t[row]:.1f} s" in text(tab, "closest")
    tab.select_option("#bodies", label="obstacle 12")
    met = first_meetings(log)[12]
    assert (f"first seen at {met:.1f} s" if math.isfinite(met) else "never seen") in text(tab, "about-body")
    box = tab.locator("#curve").bounding_box()
    tab.mouse.click(box["x"] + 44 + 2 / log.t[-1] * (box["width"] - 58), box["y"] + 60)
    drawn(tab)
    assert float(text(tab, "clock")[:-2]) == pytest.approx(2, abs=0.02)
    words = {"cruise": "top speed or accelerating", "route": "bends or tight places ahead", "curvature": "a curve"}
    rule = log.record.limiters[log.limiter[2 * log.record.physics_hz]]
    assert text(tab, "rule").startswith(words.get(rule, rule))
    assert re.match(r"✓ Reached .+\(proved\)|! .+ Not proved", text(tab, "verdict"))
    assert f"planner {log.record.planner.name}" in text(tab, "about")


def test_a_contact_is_no_clearance(opened, collided_run, tmp_path):
    tab = opened(write_page([collided_run.logged], tmp_path / "drive.html"))
    least = collided_run.rollout.clearance[collided_run.rollout.first_contact]
    shown = f"{-1000 * least:.2f} mm overlap" if least < 0 else f"{least:.3f} m"
    assert text(tab, "distance") == shown
    assert shown in text(tab, "closest")


def test_the_ground_shows_a_planners_field(opened, small_run, tmp_path):
    field = np.linspace(0, 1, small_run.grid.free.size).reshape(small_run.grid.shape)
    run = replace(small_run, plan=replace(small_run.plan, field=field, work_unit="ant steps"))
    tab = opened(write_page([run], tmp_path / "drive.html"), hash="#t=1&cam=top")
    assert "blue ground: pheromone" in text(tab, "rules")
    plain = opened(write_page([small_run.logged], tmp_path / "plain.html"), hash="#t=1&cam=top")
    assert tab.evaluate(COLOURS) > plain.evaluate(COLOURS)


def test_another_programs_log_is_shown_as_assumed(opened, here):
    setup = ForeignSetup(log=str(table(here / "log.csv")), world=str(here / "hall.yaml"))
    run = foreign_run(setup.certificate(), setup)
    tab = opened(write_page([run], here / "drive.html"))
    assert text(tab, "verdict").startswith("✓ Proved clear, as assumed: never closer than ")
    assert "collision-free" not in tab.content()
    assert "assumed: the robot kept its limits" in text(tab, "problems")
    row = len(run.rollout.t) // 2
    go(tab, f"#t={run.rollout.t[row]:.6f}")
    assert text(tab, "distance") == f"{run.rollout.clearance[row]:.3f} m"
    assert not tab.is_visible("#slowest")


def test_a_drives_page_claims_nothing_in_its_own_words(opened, page, tmp_path):
    other = tmp_path / "changed.html"
    other.write_bytes(page.read_bytes())
    changed(other, lambda _, __, stated: stated.update(line=True, claim=["✓", "Perfect"], about="mine"))
    assert text(opened(other), "verdict").startswith("✓ Reached the goal")


def test_a_failed_test_says_so_first(opened, small_run, tmp_path):
    path = write_page([small_run.logged], tmp_path / "drive.html", faults=["duration_s: 5.5, expected <= 5"])
    tab = opened(path)
    assert text(tab, "verdict").startswith("✕ Test failed. Reached the goal. Never closer")
    assert tab.get_attribute("#verdict", "class") == "bad"
    assert "expected <= 5" in text(tab, "problems")


def test_several_drives_share_one_clock(opened, small_run, collided_run, tmp_path):
    both = write_page([small_run.logged, collided_run.logged], tmp_path / "both.html", ["then", "now"])
    tab = opened(both)
    assert [button.inner_text().split()[0] for button in tab.query_selector_all("#drives button")] == ["then", "now"]
    go(tab, "#t=1")
    more = collided_run.rollout.clearance[240] - small_run.rollout.clearance[240]
    assert text(tab, "apart") == f"now 0.00 m away, {abs(more):.3f} m {'less' if more < 0 else 'more'} clearance"
    assert text(tab, "verdict").startswith("✓ then: Reached the goal")
    tab.click("#drives button:nth-child(2)")
    assert text(tab, "verdict").startswith("✕ now: Touched obstacle 1")
    assert text(tab, "apart").startswith("then ")


def test_a_drive_beside_its_baseline_shows_where_they_part(opened, small_run, tmp_path):
    line = Baseline.of(small_run, "small[0]")
    moved = replace(
        line, line=tuple((x, y + 0.5 * (k > 10), yaw, rule) for k, (x, y, yaw, rule) in enumerate(line.line))
    )
    then = baseline_rollout(moved, small_run.rollout)
    path = write_page([small_run.logged], tmp_path / "drive.html", baseline=then)
    assert Rollout.load(path).digest == small_run.rollout.digest
    tab = opened(path)
    assert "baseline at" in text(tab, "parts")
    tab.click("#parts")
    drawn(tab)
    t = float(text(tab, "clock")[:-2])
    rows = min(len(then.t), len(small_run.rollout.t))
    gone = np.hypot(*(small_run.rollout.pose[:rows, :2] - then.pose[:rows, :2]).T) > 0.01
    assert t == pytest.approx(then.t[gone.argmax()], abs=0.00501)
    tab.click("#drives button:nth-child(2)")
    assert text(tab, "verdict") == "✓ baseline: Reached the goal."
    assert "line alone" in text(tab, "proof")


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_size_and_scheme_fits_and_is_accessible(opened, mapless, size, scheme):
    tab = opened(mapless[1], size=size, color_scheme=scheme, reduced_motion="reduce")
    assert tab.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0
    assert tab.evaluate(COLOURS) > 8
    missing = "axe reads the page in chromium: pip install axe-playwright-python"
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason=missing)
    found = axe.Axe().run(tab).response["violations"]
    assert [(one["id"], one["nodes"][0]["html"]) for one in found if one["impact"] in ("serious", "critical")] == []


@pytest.mark.parametrize(("size", "scheme"), [("desk", "light"), ("phone", "dark")])
def test_the_page_prints_on_one_sheet(opened, small_run, tmp_path, size, scheme):
    drives = [small_run.logged] * 4
    tab = opened(write_page(drives, tmp_path / "drives.html", ["a", "b", "c", "d"]), size=size, color_scheme=scheme)
    assert len(re.findall(rb"/Type\s*/Page\b", tab.pdf(prefer_css_page_size=True))) == 1


def test_without_a_script_the_page_tells_its_verdict(chromium, page):
    context = chromium.new_context(java_script_enabled=False)
    tab = context.new_page()
    tab.goto(page.as_uri())
    assert "certified collision-free: clearance" in tab.inner_text("noscript")
    context.close()
