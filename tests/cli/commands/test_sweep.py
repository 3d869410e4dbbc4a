"""`antdrive sweep`: from a file, from options, again, interrupted."""

import json
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from antdrive.base.atomic import folder_lock
from antdrive.base.progress import bar, duration
from antdrive.cli.groups import _without_again
from antdrive.runs.campaigns import read_results
from tests.runs.canonical import canonical_bytes

CAMPAIGN = (
    "schema: 1\nworlds: [small.yaml]\nplanners:\n  - astar\n  - {name: aco-han, ants: [5, 10]}\nrollouts: failed\n"
)


@pytest.fixture
def campaign(small):
    path = small.with_name("campaign.yaml")
    path.write_text(CAMPAIGN)
    return path


def test_a_dry_run_says_how_many_runs_there_are_and_writes_nothing(antdrive, campaign):
    code, out, err = antdrive("sweep", campaign, "-o", "out", "--seeds", "0-4", "--dry-run")
    assert code == 0
    assert err == (
        "antdrive: seed has no effect in 1 of 3 configurations, such as small with astar: "
        "astar and the drive draw no random numbers\n"
    )
    assert out.splitlines()[-1] == "15 runs, 15 missing"
    assert not Path("out").exists()


@pytest.mark.slow
def test_a_campaign_is_run_once_and_then_goes_on_with_what_is_new(antdrive, campaign):
    code, out, _ = antdrive("sweep", campaign, "-o", "out", "--jobs", "1")
    assert code == 0
    lines = out.splitlines()
    assert lines[0] == "3 runs (3 new): 3 succeeded, certified"
    shown = {
        line.split("  ")[0]: line for line in lines[lines.index("medians of successful runs (minimum to maximum)") :]
    }
    rows = read_results("out").table.to_pylist()
    (astar,) = [row for row in rows if row["planner"] == "astar"]
    length, duration = (f"{astar[key]:.3g}" for key in ("driven_length_m", "duration_s"))
    assert f"{length} ({length} to {length})  {duration} ({duration} to {duration})" in " ".join(
        shown["astar"].split("   ")
    )
    assert lines[-1] == "  charts, intervals and all runs: antdrive report out -o out/report.html"
    made = canonical_bytes("out")
    code, out, _ = antdrive("sweep", campaign, "-o", "out", "--report", "all.md")
    assert (code, out.splitlines()[-1]) == (0, "  report   all.md")
    assert "| astar | 100.0 | 20.7 to 100.0 | 1 | 1 | 1 |" in Path("all.md").read_text()
    code, out, _ = antdrive("sweep", campaign, "-o", "out", "--seeds", "2", "--dry-run", "--json")
    assert (json.loads(out)["runs"], json.loads(out)["missing"]) == (6, 3)
    assert canonical_bytes("out") == made
    campaign.write_text(CAMPAIGN.replace("[5, 10]", "[5, 6]"))
    code, out, _ = antdrive("sweep", campaign, "-o", "out", "--jobs", "1", "--json")
    assert {key: json.loads(out)[key] for key in ("runs", "made", "outcomes")} == {
        "runs": 3, "made": 1, "outcomes": {"succeeded": 3}
    }  # fmt: skip
    campaign.write_text(CAMPAIGN)
    code, out, _ = antdrive("sweep", campaign, "-o", "out", "--json")
    assert json.loads(out)["made"] == 0, "what an earlier state of the campaign ran is kept"
    assert canonical_bytes("out") == made


@pytest.mark.slow
def test_options_mean_what_a_file_means(antdrive, campaign):
    words = ["--world", "*.yaml", "-p", "astar", "-p", "aco-han", "--set", "aco-han.ants=5,10"]
    campaign.rename("campaign.txt")
    _, out, _ = antdrive("sweep", *words, "-o", "flags", "--jobs", "1", "--json")
    assert json.loads(out)["runs"] == 3
    _, out, _ = antdrive("sweep", "campaign.txt", "-o", "flags", "--json")
    assert json.loads(out)["made"] == 0


def test_what_robots_know_is_an_option(antdrive, campaign):
    words = ["--map", "none", "--localisation", "odometry", "--odometry", "1", "--odometry", "5", "-r", "jackal"]
    code, out, _ = antdrive("sweep", campaign, *words, "--dry-run", "--json")
    assert (code, json.loads(out)["runs"], json.loads(out)["counts"]["settings"]) == (0, 6, 2)
    campaign.write_text(CAMPAIGN + "settings:\n  - {cell: 0.1}\n  - {map: given}\n")
    _, out, _ = antdrive("sweep", campaign, "--localisation", "true", "--dry-run", "--json")
    assert json.loads(out)["counts"]["settings"] == 2


@pytest.mark.slow
def test_the_command_in_a_row_repeats_the_run(antdrive, campaign, monkeypatch):
    words = ["--tasks", "2", "--noise", "1", "--smoothing", "taut", "--margin", "0.05", "--seeds", "3,7"]
    antdrive(
        "sweep",
        campaign,
        "-o",
        "out",
        "--jobs",
        "1",
        "-p",
        "aco-han",
        "-s",
        "planner.ants=5",
        "-s",
        "planner.shortcut=true",
        *words,
    )
    row = read_results("out").table.to_pylist()[-1]
    assert (row["planner"], row["task"], row["seed"]) == ("aco-han ants=5 shortcut=true", "random-0-1", 7)
    monkeypatch.chdir("out")
    command = [*shlex.split(row["command"]), "--no-figures", "--out", "again"]
    subprocess.run([sys.executable, "-m", *command], check=False, capture_output=True)
    assert json.loads(Path("again/result.json").read_text())["digest"] == row["digest"]


@pytest.mark.slow
def test_a_planner_in_a_file_is_swept_and_its_command_repeats_the_run(antdrive, campaign, monkeypatch):
    lines = ["from dataclasses import dataclass", "from antdrive.planners import AStar", "@dataclass(frozen=True)"]
    Path("mine.py").write_text("\n".join([*lines, "class Mine(AStar):", "    width: int = 3", ""]))
    code, out, _ = antdrive(
        "sweep", campaign, "-o", "out", "--jobs", "1", "-p", "mine.py:Mine", "-s", "Mine.width=4", "--json"
    )
    assert (code, json.loads(out)["succeeded"]) == (0, 1)
    (row,) = read_results("out").table.to_pylist()
    assert row["planner"] == "Mine width=4"
    monkeypatch.chdir("out")
    antdrive(*shlex.split(row["command"])[1:], "--no-figures", "--out", "again")
    found = json.loads(Path("again/result.json").read_text())
    assert (found["digest"], found["planner"]) == (row["digest"], "Mine")


@pytest.mark.slow
def test_runs_that_are_asked_for_again_count_as_missing(antdrive, campaign):
    antdrive("sweep", campaign, "-o", "out", "--jobs", "1")
    _, out, _ = antdrive(
        "sweep", campaign, "-o", "out", "--dry-run", "--again", "aco-han", "--again", "no_path", "--json"
    )
    assert json.loads(out)["missing"] == 2


def test_the_command_that_goes_on_does_not_make_runs_a_third_time():
    words = ["sweep", "c.yaml", "--again", "astar", "-o", "out", "--again=crashed"]
    assert list(_without_again(words)) == ["sweep", "c.yaml", "-o", "out"]


def test_two_commands_on_one_folder_do_not_mix(refused, campaign):
    with folder_lock("out"):
        assert "is writing to this folder; wait for it" in refused("sweep", campaign, "-o", "out", "--jobs", "1")


def test_without_parquet_the_extra_is_named(refused, campaign, monkeypatch):
    for name in ("pyarrow", "pyarrow.parquet"):
        monkeypatch.setitem(sys.modules, name, None)
    assert "pip install 'antdrive[campaigns]'" in refused("sweep", campaign, "-o", "out")


@pytest.mark.parametrize(
    ("seconds", "words"), [(7, "7 s"), (89, "89 s"), (600, "10 min"), (12000, "3 h 20 min"), (187200, "2 d 4 h")]
)
def test_times_are_told_in_fitting_units(seconds, words):
    assert duration(seconds) == words


def test_a_campaign_whose_output_goes_to_a_file_is_noted_each_minute(monkeypatch, capsys):
    now = 0.0
    monkeypatch.setattr("antdrive.base.progress.time.monotonic", lambda: now)
    with bar("driving") as update:
        for done in range(5):
            now = 30.0 * done
            update(done, 4)
    assert capsys.readouterr().err == "antdrive: driving: 2 of 4 runs, 0.0 runs/s, 60 s left\n"
