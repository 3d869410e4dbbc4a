"""A campaign's page in a browser: sorting, filtering, dialogs, phone layout and SVG charts."""

import json
import math
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from antdrive.planners import History, PlanResult, PlanStatus
from antdrive.runs.statistics.convergence import packed, unpacked
from antdrive.runs.statistics.run_table import RunTable
from antdrive.sim.log.rollout import Rollout
from antdrive.views.colour_vision import luminance
from antdrive.views.colours import label_styles
from antdrive.views.pages.campaign_summary import summarise
from antdrive.views.pages.charts import campaign_charts, write_charts
from antdrive.views.pages.rendering import Quantity
from antdrive.views.pages.report import Report, report_data
from tests.runs.made_up_campaign import Skill, made_up_columns
from tests.views.pages.browser import found_by, needs_browser, overflow_on_a_phone
from tests.views.test_colours import contrast

ODD = "</script><b>&\u2028odd"
PLANNERS = {
    "ants ants=10": Skill(0.6, 1.3, name="ants", options={"ants": 10}),
    "ants ants=50": Skill(0.8, 1.2, name="ants", options={"ants": 50}),
    "astar": Skill(0.9, 1.01, seeded=False),
}

PROBE = """<script>
window.faults = [];
window.onerror = (message) => { faults.push(String(message)); };
window.addEventListener("load", () => {
  const $ = (q, r = document) => r.querySelector(q), all = (q, r = document) => [...r.querySelectorAll(q)], found = {};
  const lines = () => all("#runs tbody tr[data-row]"), rows = () => lines().map((line) => Number(line.dataset.row));
  const set = (q, value) => { $(q).value = value; $(q).dispatchEvent(new Event(q === "#filter" ? "input" : "change")); };
  const head = (name) => $(`#runs th[data-name="${name}"] button`);
  found.lines = lines().length;
  head("duration_s").click(); found.up = rows(); found.sorted = $('#runs th[data-name="duration_s"]').ariaSort;
  head("duration_s").click(); found.down = rows();
  head("world").click(); found.world = rows();
  const box = $("#runs"); box.scrollTop = 1e7; box.dispatchEvent(new Event("scroll"));
  found.last = rows().at(-1); found.deep = lines().length;
  set("#filter", "astar duration_s>20"); found.words = rows(); found.count = $("#count").textContent;
  set("#filter", "no such thing"); found.nothing = lines().length;
  set("#filter", "ants=50"); found.option = rows().length; set("#filter", "");
  set("#outcome", "failed"); found.failed = $("#count").textContent; set("#outcome", "");
  set("#planner", "astar"); found.astar = $("#count").textContent; set("#planner", "");
  head("seed").click();
  const press = (key) => document.activeElement.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
  lines()[0].focus(); press("ArrowDown"); press("Enter");
  found.details = $("#details").textContent; found.of = rows()[1]; $("#details").close();
  found.unscoped = all("th:not([scope])").length;
  found.matrix = all("#matrix tbody tr").map((line) => all("td", line).map((cell) => cell.textContent));
  const bad = all("#matrix button:not(.full)")[0]; bad.click();
  found.cell = $("#details h3").textContent;
  found.commands = all("#details pre").map((e) => e.textContent);
  found.links = all("#details a").map((e) => e.getAttribute("href"));
  $("#details").close();
  set("#measure", "duration_s"); found.measure = all(".pairs").filter((part) => !part.hidden).map((part) => part.dataset.measure);
  set("#against", "astar"); found.against = all(".pairs:not([hidden]) tbody tr").filter((line) => !line.hidden).length;
  const legend = all(".legend button"); legend[0].click();
  found.faded = all(".charts g[class^=planner-]").map((g) => [g.getAttribute("class"), g.style.opacity]);
  found.overflow = document.documentElement.scrollWidth - document.documentElement.clientWidth;
  found.paper = getComputedStyle(document.body).backgroundColor;
  found.curves = [0, 1, 2].map((k) => getComputedStyle($(`.charts g.planner-${k} path`)).stroke);
  found.faults = faults;
  const out = document.createElement("pre"); out.id = "found"; out.textContent = JSON.stringify(found); document.body.append(out);
});
</script>"""


@pytest.fixture(scope="module")
def columns():
    found = made_up_columns(PLANNERS, worlds=10, seeds=6)
    found["world"] = [ODD if world == "world-003" else world for world in found["world"]]
    found["reason"] = [ODD if reason else None for reason in found["reason"]]
    return found


@pytest.fixture(scope="module")
def summary(columns):
    return summarise(RunTable(columns), title=ODD)


@pytest.fixture(scope="module")
def page(summary, tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    return Report.of(summary, folder / "a campaign").write(folder / "page.html")[0]


@pytest.fixture(scope="module")
def found(page):
    """Results of the probe in the page."""
    return found_by(PROBE, page)


@needs_browser
def test_in_a_browser_it_sorts_filters_and_opens(found, columns):
    assert found["faults"] == []
    count, duration = len(columns["seed"]), columns["duration_s"]
    assert (found["sorted"], found["lines"] < 60, found["deep"] < 60) == ("ascending", True, True)
    known = [k for k in range(count) if duration[k] is not None]
    ascending = sorted(known, key=lambda k: (float(f"{duration[k]:.6g}"), k))
    assert found["up"] == ascending[: len(found["up"])]
    descending = sorted(known, key=lambda k: (-float(f"{duration[k]:.6g}"), k))
    assert found["down"] == descending[: len(found["down"])]
    assert found["last"] == max(range(count), key=lambda k: (columns["world"][k] != ODD, columns["world"][k], k))
    fits = [k for k in known if columns["planner"][k] == "astar" and duration[k] > 20]
    assert sorted(found["words"]) == fits[: len(found["words"])]
    assert found["count"] == f"{len(fits)} of {count} runs"
    assert (found["nothing"], found["option"] > 0) == (0, True)
    assert found["failed"] == f"{columns['succeeded'].count(False)} of {count} runs"
    assert found["astar"] == f"{columns['planner'].count('astar')} of {count} runs"
    assert columns["command"][found["of"]] in found["details"]
    assert columns["digest"][found["of"]] in found["details"]
    assert found["unscoped"] == 0, "header cells name what they head"


@needs_browser
def test_in_a_browser_cells_show_failures_and_pairs_are_chosen(found, columns):
    names = sorted(set(columns["world"]), key=lambda name: (name != ODD, name))
    for line, world in zip(found["matrix"], names, strict=True):
        for cell, planner in zip(line, PLANNERS, strict=True):
            done = [columns["succeeded"][k] for k in range(len(columns["seed"]))
                    if (columns["world"][k], columns["planner"][k]) == (world, planner)]  # fmt: skip
            assert cell == f"{sum(done)}/{len(done)}"
    title, bad = found["cell"], found["commands"]
    assert title.endswith(f"{len(bad)} of 6 runs failed")
    assert set(bad) <= set(columns["command"])
    assert all(link.startswith("a%20campaign/rollouts/") for link in found["links"])
    assert len(found["links"]) == len(bad)
    assert (found["measure"], found["against"]) == (["duration_s"], 2)
    assert {(name == "planner-0", opacity) for name, opacity in found["faded"]} == {(True, "1"), (False, "0.12")}


@needs_browser
def test_the_page_follows_dark_mode(page, found):
    papers = {"rgb(255, 255, 255)": found, "rgb(20, 24, 31)": found_by(PROBE, page, "--force-dark-mode")}
    for paper, shown in papers.items():
        assert shown["paper"] == paper
        assert min(contrast(rgb(curve), rgb(paper)) for curve in shown["curves"]) > 3
    light, dark = papers.values()
    assert light["curves"] != dark["curves"], "colours too dark for a dark page are lighter there"


def rgb(text):
    return [int(part) for part in re.findall(r"\d+", text)]


@needs_browser
def test_on_a_phone_the_page_is_as_wide_as_the_screen(page):
    assert overflow_on_a_phone(PROBE, page) <= 0


def test_nothing_in_the_page_is_fetched_and_no_text_becomes_markup(page):
    text = page.read_text()
    assert "<b>&" not in text.replace("<b>&nbsp;", "")
    assert not re.findall(r'(?:src|href)="(?!data:|#)[^"]*"', text)
    assert text.count("</script>") == 2
    assert "http" not in re.sub(r'xmlns(:\w+)?="[^"]*"|"https?://www\.w3\.org[^"]*"', "", text)


def test_the_data_come_back_as_they_are(columns, summary, tmp_path):
    text = report_data(Report("t", summary.table, tmp_path, summary), tmp_path)
    assert not set("<\u2028") & set(text)
    data = json.loads(text)
    found = {column["name"]: column for column in data["columns"]}
    for name, values in columns.items():
        column = found.get(name)
        if column is None:
            assert all(value is None for value in values)
        elif "numbers" in column:
            factor = Quantity.of(name).factor
            for shown, value in zip(column["numbers"], values, strict=True):
                assert (shown is None) == (value is None)
                assert value is None or shown == pytest.approx(factor * value, rel=1e-5)
        else:
            places = column.get("places", range(len(values)))
            shown = [None if place < 0 else column["texts"][place] for place in places]
            tails = [f" --seed {seed}" for seed in columns["seed"]] if column.get("seeded") else [""] * len(values)
            assert [one and one + tail for one, tail in zip(shown, tails, strict=True)] == [
                None if value is None else str(value) for value in values
            ]
    assert data["good"] == [int(done) for done in columns["succeeded"]]
    assert data["shown"][:3] == ["world", "planner", "option.ants"]


def test_failed_drives_that_have_logs_have_pages_and_other_files_none(columns, small_run, tmp_path):
    """Names that lead out of the campaign's folder are no logs of it."""
    camp, table = tmp_path / "camp", RunTable(columns)
    names, failed = [None] * len(table), np.flatnonzero(~table.success)
    for row, name in zip(failed.tolist(), ("logs/a.npz", "../b.npz", "logs/gone.npz", "logs/bad.npz"), strict=False):
        names[row] = name
    for name in ("logs/a.npz", "../b.npz"):
        small_run.rollout.save(camp / name)
    (camp / "logs" / "bad.npz").write_bytes(b"no log")
    report = Report.of(summarise(RunTable({**table.columns, "rollout": names}), title="t"), camp)
    views = json.loads(report_data(report, tmp_path))["views"]
    assert views == {str(failed[0]): "camp/logs/a.html"}
    assert Rollout.load(camp / "logs" / "a.html").digest == small_run.rollout.digest
    assert [path.name for path in tmp_path.rglob("*.html")] == ["a.html"]


@pytest.fixture(scope="module")
def styles(summary):
    return label_styles(summary.paired.planners, ["ants", "ants", "astar"])


@pytest.fixture(scope="module")
def charts(summary, styles):
    return campaign_charts(summary, styles)


def test_charts_are_svg_with_a_curve_for_each_planner(charts, page):
    measured = "driven length", "duration", "planning time"
    compared = [f"{kind}: {name}" for name in measured for kind in ("Performance profile", "Paired differences")]
    sized = [
        f"{by}: {name}" for by in ("By world size", "ants by ants") for name in ("planning time", "gap to grid optimum")
    ]
    assert [chart.title for chart in charts] == [*compared, *sized]
    for chart in charts:
        tree = ElementTree.fromstring(chart.svg)
        assert "width" not in tree.attrib
        if chart.title.startswith("Performance"):
            curves = [node for node in tree.iter() if node.get("class", "").startswith("planner-")]
            assert len(curves) == 3
            assert all(f"var(--{node.get('class')})" in ElementTree.tostring(node, "unicode") for node in curves)
        assert "var(--planner-" in chart.svg or chart.title.startswith("Paired")
    shown = page.read_text()
    assert all(chart.svg in shown for chart in charts), "drawn again, the same bytes"


@pytest.mark.parametrize("different", [True, False])
def test_worlds_are_grouped_by_area_or_where_that_is_one_by_their_shortest_paths(different):
    columns = made_up_columns({"a": Skill(1.0), "b": Skill(1.0)}, worlds=6, seeds=2)
    columns["duration_s"] = columns["driven_length_m"] = columns["gap_to_grid_optimum"] = [None] * 24
    if not different:
        columns["plan_s"] = [0.1] * 24
    for areas, says in (([4.0, 9.0, 400.0], "area of the world"), ([4.0] * 3, "shortest path on the grid")):
        columns["area_m2"] = [areas[int(world[-1]) % 3] for world in columns["world"]]
        charts = campaign_charts(summarise(RunTable(columns), title="t", metrics=["plan_s"]), label_styles("ab", "ab"))
        (chart,) = (chart for chart in charts if chart.title.startswith("By world size"))
        assert f"by {says}" in chart.note
        assert "12 instances" in chart.note
        assert ("(4 each)" in chart.note) == ("area" in says)
        words = {text.get_text() for axes in chart.figure.axes for text in axes.texts}
        assert words == (set() if different else {"identical to a"})


@pytest.mark.slow
def test_long_names_of_planners_stay_whole_and_apart(tmp_path):
    names = [f"aco-han alpha={k} ants=10 iterations=100 cap=200" for k in range(3)]
    columns = made_up_columns({name: Skill(1.0) for name in names}, worlds=4, seeds=2)
    summary = summarise(RunTable(columns), title="t")
    charts = campaign_charts(summary, label_styles(names))
    chart = next(chart for chart in charts if chart.title.startswith("By world size"))
    chart.figure.draw_without_rendering()
    titles = [axes._left_title for axes in chart.figure.axes]
    assert [title.get_text().replace("\n", " ") for title in titles] == names
    boxes = [title.get_window_extent() for title in titles]
    assert not any(one.overlaps(other) for k, one in enumerate(boxes) for other in boxes[:k])
    page = Report.of(summary, tmp_path).write(tmp_path / "page.html")[0].read_text()
    styles = "".join(re.findall(r"<style>(.*?)</style>", page, flags=re.DOTALL))
    assert re.findall(r"([^{}]*){[^{}]*text-overflow", styles) == [" #runs td, #runs th "]


def test_two_varied_options_have_heat_maps_and_histories_curves_by_three_kinds_of_effort():
    labels = [(ants, rate) for ants in (10, 50) for rate in (0.1, 0.5)]
    options = [{"ants": ants, "rate": rate} for ants, rate in labels]
    planners = {
        f"ants ants={o['ants']} rate={o['rate']}": Skill(1.0, 1.0 + o["rate"], name="ants", options=o) for o in options
    }
    columns = made_up_columns(planners, worlds=3, seeds=2)
    best = np.array([[9.0, 8.0, 8.0], [math.inf, 9.5, 9.5]])
    plans = [PlanResult(history=History(best=one), status=PlanStatus.SOLVED, work=600) for one in best]
    assert [unpacked(packed(plan)).best.tolist() for plan in plans] == best.tolist()
    assert packed(PlanResult(status=PlanStatus.NO_PATH)) is None
    columns["history"] = [packed(plans[k % 2]) for k in range(len(columns["seed"]))]
    columns["grid_optimum_m"] = [4.0] * len(columns["seed"])
    summary = summarise(RunTable(columns), title="t", metrics=["duration_s"])
    charts = {chart.title: chart.figure for chart in campaign_charts(summary, label_styles(list(planners)))}
    axes = charts["ants by ants and rate: median duration"].axes[0]
    assert [[label.get_text() for label in ticks] for ticks in (axes.get_yticklabels(), axes.get_xticklabels())] == [
        ["10", "50"], ["0.1", "0.5"],
    ]  # fmt: skip
    assert (np.diff(axes.images[0].get_array(), axis=1) > 0).all(), "longer with a larger rate"
    ends = []
    for axis in ("iteration", "work", "planning time"):
        (drawn, *_) = charts[f"Convergence by {axis}"].axes[0].lines
        assert drawn.get_ydata()[-1] == pytest.approx((2.0 + 9.5 / 4) / 2)
        ends.append(drawn.get_xdata()[-1])
    assert ends[:2] == [3, pytest.approx(600e-6)]


def test_charts_need_no_optional_columns():
    columns = made_up_columns({"a": Skill(0.0), "b": Skill(0.0)}, worlds=2, seeds=2)
    assert campaign_charts(summarise(RunTable(columns), title="t"), label_styles("ab", "ab")) == []
    bare = {name: columns[name] for name in ("world", "planner", "seed", "outcome", "succeeded")}
    assert campaign_charts(summarise(RunTable(bare), title="t"), label_styles("ab", "ab")) == []


def test_times_that_are_all_zero_have_a_chart():
    columns = made_up_columns({"a": Skill(1.0), "b": Skill(1.0)})
    columns["plan_s"] = [0.0] * len(columns["plan_s"])
    charts = campaign_charts(summarise(RunTable(columns), title="t"), label_styles("ab", "ab"))
    assert "Performance profile: planning time" in [chart.title for chart in charts]


def test_styles_of_labels_differ_and_are_readable_on_their_ground():
    names = ["ants"] * 6 + ["aco-han"] * 3 + ["astar", "mmas", "plugin"]
    styles = label_styles([f"{name} {k}" for k, name in enumerate(names)], names)
    assert len({style.light for style in styles}) == len(styles)
    for style in styles:
        light, dark = (
            luminance((int(c[1:3], 16), int(c[3:5], 16), int(c[5:7], 16))) for c in (style.light, style.dark)
        )
        assert light <= 0.46
        assert dark > 0.21


def test_charts_for_a_thesis_have_truetype_fonts_names_and_one_width(summary, styles, charts, tmp_path):
    *files, captions = write_charts(charts[:1], summary.paired.planners, tmp_path, width=3.4)
    assert [path.suffix for path in files] == [".pdf", ".svg"]
    assert files[0].name == "performance-profile-driven-length.pdf"
    assert r"\includegraphics{performance-profile-driven-length}" in captions.read_text()
    assert "Higher is better" in captions.read_text()
    for path in files:
        content = path.read_bytes()
        if path.suffix == ".pdf":
            assert b"/Type3" not in content
            assert b"/TrueType" in content or b"/Type0" in content
            assert b"/MediaBox [ 0 0 244.8 " in content
        else:
            assert all(style.light.encode() in content for style in styles)


def test_an_own_planner_has_the_same_colour_in_campaigns_as_in_films():
    columns = made_up_columns({"Greedy": Skill(), "astar": Skill()}, worlds=2, seeds=1)
    columns["planner_name"] = ["mine.py:Greedy" if label == "Greedy" else label for label in columns["planner"]]
    summary = summarise(RunTable(columns), title="t")
    assert Report("t", summary.table, Path(), summary).styles == label_styles(summary.paired.planners)


@pytest.mark.slow
def test_8500_runs_make_a_page_below_10_megabytes(tmp_path):
    planners = {f"planner-{k}": Skill(0.98 - 0.01 * k, 1.0 + 0.02 * k) for k in range(17)}
    summary = summarise(RunTable(made_up_columns(planners, worlds=50, seeds=10)), title="big")
    page = Report.of(summary, tmp_path).write(tmp_path / "page.html")[0]
    assert len(summary.table) == 8500
    assert page.stat().st_size < 10_000_000
    assert np.isfinite([row.interval.low for row in summary.success]).all()
