"""Pages of drives as files: they hold the logs exactly, `verify` reads them, and what was changed is named."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from antdrive.base.errors import InputError
from antdrive.runs.suites.baseline import Baseline
from antdrive.sim.facts import LoggedRun
from antdrive.sim.log import packing
from antdrive.sim.log.rollout import MAX_BYTES, Rollout, stated_by
from antdrive.views.artefacts import baseline_rollout
from antdrive.views.viewer.drive_page import MODULES, script, write_page
from tests.changed_page import changed
from tests.made_up_drive import scanned

ARRAYS = ("t", "pose", "twist", "clearance", "limiter", "movers", "contacts", "route", "cells")


@pytest.fixture(scope="module")
def page(small_run, tmp_path_factory):
    """The page of a drive in physics."""
    return write_page([small_run.logged], tmp_path_factory.mktemp("page") / "drive.html")


@pytest.fixture
def copy(page, tmp_path):
    return Path(shutil.copy(page, tmp_path))


def test_a_page_holds_the_log_exactly(small_run, page):
    log, found = small_run.rollout, Rollout.load(page)
    assert found.digest == log.digest == found.record.digest
    for name in ARRAYS:
        assert getattr(found, name).tobytes() == getattr(log, name).tobytes()
    assert found.record.written == log.record.written


def test_verify_reads_a_page(antdrive, page):
    code, out, _ = antdrive("verify", page)
    assert code == 0
    assert f"{page}: certified collision-free" in out


def test_margin_and_export_read_a_page(antdrive, copy):
    assert antdrive("margin", copy)[0] == 0
    assert antdrive("export", copy, "--to", "csv", "-o", "tables")[0] == 0


def test_view_writes_the_page_beside_the_log_and_opens_nothing(antdrive, small_run, monkeypatch):
    monkeypatch.setattr("webbrowser.open", lambda _: pytest.fail("opened a browser"))
    Path("run").mkdir()
    small_run.rollout.save("run/rollout.npz")
    assert antdrive("view", "run") == (0, "  page     run/drive.html\n", "")
    assert antdrive("view", "run/drive.html", "-o", "again.html")[0] == 0
    assert Path("again.html").read_text() == Path("run/drive.html").read_text()


def test_drives_of_one_planner_have_their_folders_names(antdrive, small_run):
    for name in ("then", "now"):
        Path(name).mkdir()
        small_run.rollout.save(f"{name}/rollout.npz")
    assert antdrive("view", "then", "now", "--out", "both.html")[0] == 0
    assert [stated_by(f"both.html#{k}")["label"] for k in (1, 2)] == ["then", "now"]


def test_several_logs_are_read_by_their_number(antdrive, refused, small_run, collided_run, tmp_path):
    both = write_page([small_run.logged, collided_run.logged], tmp_path / "both.html", ["then", "now"])
    assert Rollout.load(f"{both}#1").digest == small_run.rollout.digest
    assert Rollout.load(f"{both}#2").digest == collided_run.rollout.digest
    assert stated_by(f"{both}#2")["label"] == "now"
    assert antdrive("verify", f"{both}#1")[0] == 0
    assert "holds 2 logs; name one" in antdrive("verify", both)[2]
    assert "holds 2 logs, none of number 3" in antdrive("verify", f"{both}#3")[2]


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda arrays, *_: np.add(arrays["pose"], [1e-12, 0, 0], out=arrays["pose"]), "digest: the log was changed"),
        (lambda _, record, __: record.update(seed=8), "digest: the log was changed"),
        (lambda _, __, stated: stated["certificate"].update(bound_m=0.5), "the page: certificate: differs"),
        (
            lambda _, __, stated: stated["certificate"].update(certified=False),
            "the page: certificate: differs",
        ),
        (lambda _, __, stated: stated.update(digest="0"), "the page: belongs to another log"),
        (lambda _, __, stated: stated.update(command="rm -r /"), "the page: command: differs"),
    ],
)
def test_a_changed_page_is_not_certified(antdrive, copy, change, problem):
    changed(copy, change)
    code, out, err = antdrive("verify", copy)
    assert code == 1
    assert problem in out + err


def test_a_command_may_write_its_numbers_otherwise(antdrive, copy):
    changed(copy, lambda _, __, stated: stated.update(command=stated["command"].replace("--seed 0", "--seed 0.0")))
    assert "--seed 0.0" in stated_by(copy)["command"]
    assert antdrive("verify", copy)[0] == 0


def forged(page, beside, **kept):
    """Put other keys beside the digest, or another statement, into the log of a page."""
    text = page.read_text(encoding="utf-8")
    log = packing.packed_in(text.encode(), page.name)
    arrays, record, stated = packing.unpack(log, MAX_BYTES)
    values = json.loads(record)
    beside = {key: values.pop(key) for key in packing.UNHASHED if key in values} | beside
    more = packing.pack(arrays, json.dumps(values, sort_keys=True), beside, kept.get("stated", stated))
    page.write_text(text.replace(log.decode(), more))


@pytest.mark.parametrize("more", [{"seed": 99}, {"colour": "red"}])
def test_keys_beside_the_digest_hold_no_more_than_it_leaves_out(antdrive, copy, more):
    forged(copy, more)
    code, _, err = antdrive("verify", copy)
    assert code == 2
    assert "outside what its digest covers" in err
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize("stated", [[], None, "good"])
def test_a_page_that_states_no_mapping_is_refused(antdrive, copy, stated):
    forged(copy, {}, stated=stated)
    assert antdrive("verify", copy)[0] == 2


def test_a_page_is_no_other_kind_of_file(antdrive, small_run, tmp_path):
    log = small_run.rollout.save(tmp_path / "rollout.npz")
    before = log.read_bytes()
    for name in ("rollout.npz", "drive.txt"):
        code, _, err = antdrive("view", log, "--out", tmp_path / name)
        assert (code, "the name of a page ends in .html" in err) == (2, True)
    assert log.read_bytes() == before


def test_a_page_that_shows_the_drive_is_kept(antdrive, small_run, collided_run, tmp_path):
    log, page = small_run.rollout.save(tmp_path / "rollout.npz"), tmp_path / "drive.html"
    write_page([small_run.logged], page, baseline=baseline_rollout(Baseline.of(small_run, "a"), small_run.rollout))
    before = page.read_bytes()
    assert antdrive("view", log)[0] == antdrive("view", page)[0] == 0
    assert page.read_bytes() == before
    write_page([collided_run.logged], page)
    assert antdrive("view", log)[0] == 0
    assert Rollout.load(page).digest == small_run.rollout.digest


def test_first_sights_of_a_page_are_compared(antdrive, made_up_drive, tmp_path):
    path = write_page([LoggedRun.of(scanned(made_up_drive(movers=1)))], tmp_path / "drive.html")
    assert "seen" not in antdrive("verify", path)[2]
    changed(path, lambda _, __, stated: stated["seen"].__setitem__(0, 0.125))
    code, out, err = antdrive("verify", path)
    assert code == 1
    assert "the page: seen: differs from the log's scans" in out + err


@pytest.mark.parametrize("text", ["", "<p>no log</p>", '<script class="drive">x</script>'])
def test_a_page_without_a_log_is_named(refused, tmp_path, text):
    other = tmp_path / "other.html"
    other.write_text(text)
    assert (
        refused("verify", other)
        == f"antdrive: {other}: not a rollout (a page without a log; name a page of antdrive view)\n"
    )


def test_a_cut_page_is_refused_in_one_line(refused, copy):
    text = copy.read_text()
    copy.write_text(re.sub(r'(class="drive">.{900}).{400}', r"\1", text, flags=re.DOTALL))
    assert refused("verify", copy).startswith(f"antdrive: {copy}: not a rollout (")


def test_drives_of_several_worlds_share_no_page(small_run, made_up_drive, tmp_path):
    with pytest.raises(InputError, match="a page shows drives of one world"):
        write_page([small_run.logged, LoggedRun.of(made_up_drive())], tmp_path / "both.html")


def test_names_from_files_stay_text(small_run, tmp_path):
    record = small_run.rollout.record
    world = replace(record.task.world, name="</script><b>")
    log = replace(small_run.rollout, record=replace(record, task=replace(record.task, world=world)))
    text = write_page([LoggedRun.of(log)], tmp_path / "drive.html", ["<i>"]).read_text()
    assert "<b>" not in text
    assert "<i>" not in text


def test_the_viewer_loads_nothing_and_is_small():
    assert len(script().encode()) <= 60_000
    assert not re.search(r"https?://|import\s|eval\(|innerHTML", script())
    folder = Path(packing.__file__).parents[2] / "views" / "viewer" / "assets"
    assert sum((folder / f"{name}.js").read_text().count("\n") for name in MODULES) <= 1200


@pytest.mark.slow
def test_pages_keep_their_budgets(made_up_drive, antdrive, tmp_path):
    """Bytes of a viewer without a drive, of 30 s with a map, and of 30 s with 720 beams at 50 Hz."""
    assert antdrive("run", "forest", "-p", "astar", "--no-figures", "-o", "run")[0] == 0
    page = Path("run/drive.html").read_bytes()
    log = packing.packed_in(page, "drive.html")
    shell, seconds = len(page) - len(log), Rollout.load("run/drive.html").t[-1]
    assert shell < 150_000
    assert shell + len(log) * 30 / seconds < 300_000
    drive = made_up_drive(obstacles=60, seconds=30.0, size=(20.0, 15.0))
    scans = scanned(drive, beams=720, rate=50.0)
    rough = scans.scans + np.random.default_rng(1).normal(0, 5, scans.scans.shape)
    noisy = np.where(scans.scans > 1, np.maximum(2, rough), scans.scans).astype(np.uint16)
    wide = write_page([LoggedRun.of(replace(scans, scans=noisy))], tmp_path / "scans.html")
    assert wide.stat().st_size < 3_000_000
