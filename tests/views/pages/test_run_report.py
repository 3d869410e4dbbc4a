"""The report of runs as text and in a browser: details and links; the table is as in a campaign's page."""

import html
import json
import os
import re
import shutil
from dataclasses import replace
from urllib.parse import unquote

import numpy as np
import pytest

import antdrive
from antdrive.base import InputError
from antdrive.planners import load_planner
from antdrive.sim import run
from antdrive.views.figures.run_figures import overview
from antdrive.views.pages.report import write_report
from tests.records import changed
from tests.views.pages.browser import found_by, needs_browser, overflow_on_a_phone

PROBE = """<script>
window.faults = [];
window.onerror = (message) => { faults.push(String(message)); };
const lost = (e) => { if (e.target !== window) faults.push("cannot load " + (e.target.src || e.target.href)); };
window.addEventListener("error", lost, true);
window.onload = async () => {
  const rows = () => [...document.querySelectorAll("#runs tbody tr[data-row]")], found = {};
  const filter = document.querySelector("#filter");
  filter.value = "astar COLLIDED"; filter.dispatchEvent(new Event("input"));
  found.shown = rows().map((row) => Number(row.dataset.row));
  filter.value = ""; filter.dispatchEvent(new Event("input"));
  const outcome = document.querySelector("#outcome"); outcome.value = "succeeded, claimed";
  outcome.dispatchEvent(new Event("change"));
  found.succeeded = rows().length;
  rows()[0].click();
  found.told = document.querySelector("#details").textContent;
  found.links = [...document.querySelectorAll("#details a, #runs a")].map((link) => link.getAttribute("href"));
  document.querySelector("#details").close();
  found.overflow = document.documentElement.scrollWidth - document.documentElement.clientWidth;
  found.faults = faults;
  const out = document.createElement("pre"); out.id = "found"; out.textContent = JSON.stringify(found); document.body.append(out);
};
</script>"""


@pytest.fixture(scope="module")
def runs(made_up_drive, tmp_path_factory):
    """Three runs without logs, one with a film, one with a collision."""
    folder = tmp_path_factory.mktemp("runs")
    for k, (planner, outcome) in enumerate((("mmas", "succeeded"), ("astar", "collided"), ("<b>odd</b>", "succeeded"))):
        place = folder / f"run {k}"
        place.mkdir()
        facts = {
            "world": "made-up", "planner": planner, "robot": "turtlebot", "seed": k, "outcome": outcome, "reason": "",
            "sentence": "touched an obstacle" if outcome == "collided" else "stopped at the goal without contact",
            "succeeded": outcome == "succeeded", "command": f"antdrive run made-up --planner '{planner}'", "digest": "0",
            "metrics": {"path_length_m": 3.0, "driven_length_m": (10.5, 9.25, 100.0)[k], "duration_s": 1.0},
            "certificate": {"certified": outcome == "succeeded", "bound_m": 0.1, "problems": ["it touched"] * (k == 1)},
        }  # fmt: skip
        (place / "result.json").write_text(json.dumps(facts))
        if k == 0:
            overview(made_up_drive(), place / "overview.png", dpi=60)
            (place / "film.mp4").write_bytes(b"film")
        else:
            shutil.copy(folder / "run 0" / "overview.png", place)
    return folder


@needs_browser
def test_in_a_browser_rows_are_filtered_open_and_link_what_there_is(runs, tmp_path):
    (runs / "run 2" / "drive.html").touch()
    write_report(runs, tmp_path / "report.html")
    found = found_by(PROBE, tmp_path / "report.html")
    assert found["faults"] == []
    assert found["shown"] == [1]
    assert found["succeeded"] == 2
    assert "Claimed by result.json, without a log." in found["told"]
    runs = os.path.relpath(runs, tmp_path)
    assert sorted(unquote(link) for link in set(found["links"])) == [f"{runs}/run 0", f"{runs}/run 2/drive.html"]


@needs_browser
def test_on_a_phone_the_page_is_as_wide_as_the_screen(runs, tmp_path):
    write_report(runs, tmp_path / "report.html")
    assert overflow_on_a_phone(PROBE, tmp_path / "report.html") == 0


def test_the_page_needs_no_network_and_escapes_its_content(runs, tmp_path):
    assert write_report(runs, tmp_path / "report.html", title="Ours & theirs").runs == 3
    text = (tmp_path / "report.html").read_text()
    assert "Ours &amp; theirs" in text
    assert "<b>odd</b>" not in text, "what files say is shown, not run"
    assert not re.search(r"(src|href)=\"(https?:)?//", text)
    assert "run%200" in text
    assert len(text) < 60_000


def test_the_markdown_is_a_table_with_links_and_commands(runs, tmp_path):
    write_report(runs, runs / "report.md")
    text = (runs / "report.md").read_text()
    lines = text.splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith("| world"))
    table = lines[start : start + 5]
    assert all(line.startswith("|") for line in table)
    assert len({line.count("|") for line in table}) == 1
    assert "- [made-up](run%201) · astar · seed 1: collided, claimed" in text


def write_run(run, folder, **claims):
    """A run of the command line, with edited claims in result.json."""
    folder.mkdir(parents=True)
    run.rollout.save(folder / "rollout.npz")
    facts = {**run.as_dict(), "command": "antdrive run small", **claims}
    (folder / "result.json").write_text(json.dumps(facts))
    return folder


def reported(folder, tmp_path, kind="html"):
    write_report(folder, tmp_path / f"report.{kind}")
    return (tmp_path / f"report.{kind}").read_text()


@pytest.mark.parametrize("kind", ["html", "md"])
def test_the_log_is_believed_and_not_result_json(small_run, collided_run, tmp_path, kind):
    claims = {**small_run.as_dict(), "digest": collided_run.rollout.digest, "world": "elsewhere"}
    write_run(collided_run, tmp_path / "runs" / "a", **claims)
    text = reported(tmp_path / "runs", tmp_path, kind)
    assert "0 / 1" in text
    assert "Not certified collision-free." in text
    assert "physics reports" in text
    assert "elsewhere" not in text
    if kind == "html":
        assert collided_run.rollout.record.outcome.value.capitalize() in text


def test_a_genuine_run_is_shown_as_certified(small_run, tmp_path):
    write_run(small_run, tmp_path / "runs" / "a")
    text = reported(tmp_path / "runs", tmp_path)
    assert "1 / 1" in text
    assert "Certified collision-free: at least" in text
    assert "result.json: belongs to another log" not in text
    write_run(small_run, tmp_path / "others" / "a", digest="0" * 64)
    assert "result.json: belongs to another log: its digest differs" in reported(tmp_path / "others", tmp_path)


def test_without_a_log_a_drive_is_a_claim(small_run, tmp_path):
    (write_run(small_run, tmp_path / "runs" / "a") / "rollout.npz").unlink()
    text = reported(tmp_path / "runs", tmp_path)
    assert "0 / 1" in text
    assert "succeeded, claimed" in text
    assert "Claimed by result.json, without a log." in text


def test_a_page_outside_the_folder_is_not_linked(small_run, tmp_path):
    (tmp_path / "outside.html").touch()
    folder = write_run(small_run, tmp_path / "runs" / "a", files={"page": str(tmp_path / "outside.html")})
    (folder / "drive.html").symlink_to(tmp_path / "outside.html")
    text = reported(tmp_path / "runs", tmp_path)
    assert not {"outside", "drive.html"} & set(re.split(r"[/\"]", text))
    (folder / "drive.html").unlink()
    (folder / "drive.html").touch()
    assert "runs/a/drive.html" in reported(tmp_path / "runs", tmp_path)


ODD_NAME = "a|b|c `x` <script>alert(1)</script> ``` </details> [u](v) *s*"


def test_markdown_shows_odd_names_as_they_are(small_run, tmp_path):
    task = small_run.scenario.task
    record = replace(small_run.rollout.record, task=changed(task, "world", name=ODD_NAME), written=None)
    odd = changed(small_run, "rollout", record=record)
    write_run(
        odd, tmp_path / "runs" / "a", command="rm -rf ~ # antdrive run ```x\n```\n<b>", reason="\x1b[31mred\u202e"
    )
    text = reported(tmp_path / "runs", tmp_path, "md")
    assert "<script>" not in text
    rows = [line for line in text.splitlines() if line.startswith("|")]
    assert len(rows) == 3
    assert len({line.count("|") for line in rows}) == 1
    assert "rm -rf" not in text, "commands are the record's, not result.json's"
    assert "antdrive run a_b_c" not in text, "it succeeded"
    assert not set("\x1b\u202e") & set(text)
    assert "a&#124;b&#124;c" in text


ODD_VALUES = [
    None, True, 0, -1.5, 10**400, "", "x" * 5000, "a\nb\x00\ud800", [], [1, [2]], {}, {"film": {}}, "/etc/hosts",
]  # fmt: skip


def test_no_value_in_result_json_ends_in_a_traceback(small_run, tmp_path):
    """Each key with five odd values, one of them beside a log, too: six runs on a page."""
    rng = np.random.default_rng(3)
    facts = json.loads((write_run(small_run, tmp_path / "runs" / "driven") / "result.json").read_text())
    for k in range(5):
        (tmp_path / "runs" / f"claimed-{k}").mkdir()
    for turn, key in enumerate([*facts, "files", "metrics.spl", "metrics.driven_length_m", "certificate.bound_m"]):
        value = ODD_VALUES[rng.integers(len(ODD_VALUES))]
        for k, odd in enumerate((value, None, [], 10**400, "a\ud800")):
            edited = json.loads(json.dumps(facts))
            place, _, inner = key.partition(".")
            if inner:
                edited[place][inner] = odd
            else:
                edited[place] = odd
            for folder in ("driven", f"claimed-{k}")[k != turn % 2 :]:
                (tmp_path / "runs" / folder / "result.json").write_text(json.dumps(edited))
        assert "1 / 6" in reported(tmp_path / "runs", tmp_path, ("html", "md")[turn % 2]), key


def test_files_that_cannot_be_read_are_one_line(small_run, tmp_path):
    folder = write_run(small_run, tmp_path / "runs" / "a")
    (folder / "rollout.npz").write_bytes(b"no log")
    with pytest.raises(InputError, match=r"rollout\.npz: not a rollout"):
        write_report(tmp_path / "runs", tmp_path / "report.html")


def columns_of(page):
    """Return a page's columns and the names of the shown ones."""
    data = json.loads(re.search(r'id="data">(.*?)</script>', page, re.S)[1])
    found = {c["name"]: c.get("numbers") or [c["texts"][k] for k in c.get("places", range(data["rows"]))]
             for c in data["columns"]}  # fmt: skip
    return found, data["shown"]


def test_settings_that_differ_between_runs_get_columns(small_scenario, tmp_path):
    write_run(run(small_scenario), tmp_path / "runs" / "a")
    same = columns_of(reported(tmp_path / "runs", tmp_path))[1]
    assert same[:4] == ["world", "planner", "outcome", "seed"]
    write_run(run(replace(small_scenario, smoothing="none", noise=0.5)), tmp_path / "runs" / "b")
    for name, ants in (("c", 20), ("d", 30)):
        planner = load_planner("as", ants=ants, iterations=3)
        write_run(run(replace(small_scenario, planner=planner, planner_name="as")), tmp_path / "runs" / name)
    (tmp_path / "runs" / "d" / "rollout.npz").unlink()  # a claim shows its settings, too
    text = reported(tmp_path / "runs", tmp_path)
    columns, shown = columns_of(text)
    different = ["smoothing", "noise", "margin", "option.ants"]
    assert shown == [*same[:2], *different, *same[2:]], "not the cell: it is the same in all runs"
    assert columns["planner"][2:] == ["as ants=20", "as ants=30"]
    assert [columns[name] for name in ("option.ants", "smoothing", "noise")] == [
        [None, None, 20, 30], ["clearance", "none", "clearance", "clearance"], [0, 0.5, 0, 0],
    ]  # fmt: skip
    lines = [line for line in reported(tmp_path / "runs", tmp_path, "md").splitlines() if line.startswith("|")]
    assert len({line.count("|") for line in lines}) == 1


def fake_run(folder, *, outcome="succeeded", **more):
    """Write the result.json of a claimed run, with a film beside it."""
    folder.mkdir(parents=True)
    facts = {"world": "w", "planner": "astar", "robot": "turtlebot", "seed": 0, "command": "antdrive run w"}
    (folder / "result.json").write_text(json.dumps({**facts, "outcome": outcome, **more}))
    (folder / "a film.mp4").write_bytes(b"film")


def test_the_markdown_of_300_runs_is_short_with_failures_first(tmp_path):
    for k in range(300):
        long = {"reason": "*" * 190, "command": "`" * 3500} if k % 2 else {}
        fake_run(tmp_path / "runs" / f"{k:04}", outcome="no_path" if k % 50 == 7 else "timed_out", seed=k, **long)
    write_report(tmp_path / "runs", tmp_path / "report.md")
    content = (tmp_path / "report.md").read_bytes()
    assert 10_000 < len(content) < 60_000
    text = content.decode()
    rows = [line for line in text.splitlines() if line.startswith("| w |")]
    told = re.search(r"Not in the table: (.*)\.", text).group(1)
    assert len(rows) + sum(int(n.replace(",", "")) for n in re.findall(r"(\d[\d,]*) \w", told)) == 300


def test_markdown_puts_failures_first_with_their_commands(small_run, collided_run, tmp_path):
    write_run(small_run, tmp_path / "runs" / "a")
    write_run(collided_run, tmp_path / "runs" / "b")
    text = reported(tmp_path / "runs", tmp_path, "md")
    rows = [line for line in text.splitlines() if line.startswith("| small")]
    assert ["❌" in row for row in rows] == [True, False]
    assert "- [small](runs/b)" in text
    assert text.count("antdrive run small") == 1
    assert "Not in the table" not in text


@pytest.mark.slow
def test_runs_made_in_python_become_a_report_together_with_folders(small_run, collided_run, tmp_path):
    write_run(small_run, tmp_path / "runs" / "a")
    page = tmp_path / "page.html"
    assert antdrive.write_report([small_run, collided_run, tmp_path / "runs"], str(page), title="mine").runs == 3
    text = page.read_text()
    assert "2 / 3" in text
    assert antdrive.write_report(small_run, tmp_path / "page.md").runs == 1
    assert "1 / 1" in (tmp_path / "page.md").read_text()


def test_an_edited_run_is_certified_again(small_run, tmp_path):
    shifted = replace(small_run.rollout, pose=small_run.rollout.pose + (0.0, 0.2, 0.0))
    write_report(replace(small_run, rollout=shifted), tmp_path / "page.html")
    assert "0 / 1" in (tmp_path / "page.html").read_text()


@pytest.mark.parametrize("kind", ["html", "md"])
def test_a_run_that_a_test_drove_says_why_the_test_failed(small_run, tmp_path, kind):
    """The drive succeeded; claims of result.json are plain text."""
    folder = tmp_path / "results"
    write_run(small_run, folder / "plain")
    assert "failed:" not in reported(folder, tmp_path, kind)
    slower, check = (
        "duration_s: 9 s, in the baseline 5 s: 4 s longer <script>",
        "antdrive check 'a.drive.yaml::hall[0]'",
    )
    write_run(small_run, folder / "test", faults=[slower, 3, None], command=check)
    write_run(small_run, folder / "odd", faults="oops", command="pytest a.py::b; rm -rf .")
    text = reported(folder, tmp_path, kind)
    assert "2 / 3" in text, "a drive to the goal whose test failed is no success"
    assert "succeeded, test failed" in text
    plain = html.unescape(text).replace("\\", "")
    assert "9 s, in the baseline 5 s: 4 s longer" in plain
    assert "longer <script>" not in text
    assert check in plain, "as the terminal says"
    assert "rm -rf" not in text
