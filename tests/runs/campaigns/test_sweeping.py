"""A campaign runs what its folder lacks, and its table and its logs say what came out, whatever goes wrong in a run."""

import dataclasses
import errno
import re
from pathlib import Path

import numpy as np
import pytest

from antdrive import Rollout, Scenario, load_task, run
from antdrive.base.errors import InputError
from antdrive.planners import PlannerError
from antdrive.robots import load_robot
from antdrive.runs.campaigns import expand, job, make_campaign, read_results, running, sweep, sweeping
from antdrive.runs.campaigns.running import Driving, log_path
from antdrive.runs.campaigns.sweeping import calibrated
from antdrive.runs.margins.choice import Calibration
from antdrive.worlds import Disc, Task, World, save_task
from tests.runs.campaigns.works import Deadly
from tests.runs.canonical import canonical_bytes

TWO_BY_TWO = {"worlds": ["small.yaml", "other.yaml"], "planners": ["astar", {"name": "aco-han", "ants": 10}]}


@pytest.fixture
def worlds(tmp_path, monkeypatch):
    """The working directory, with two small worlds."""
    monkeypatch.chdir(tmp_path)
    for name, y in (("small", 1.5), ("other", 1.2)):
        world = World(name, (0.0, 0.0, 4.0, 3.0), (Disc(2.0, y, 0.3),))
        save_task(Task(world, (0.6, 1.4, 0.0), (3.4, 1.6), cell=0.2), tmp_path / f"{name}.yaml")
    return tmp_path


def test_each_world_is_driven_with_each_planner_as_run_does_it(worlds):
    results = sweep(TWO_BY_TWO, "out", jobs=0)
    rows = results.table.to_pylist()
    assert [(row["world"], row["planner"]) for row in rows] == [
        ("small", "astar"), ("small", "aco-han ants=10"), ("other", "astar"), ("other", "aco-han ants=10")
    ]  # fmt: skip
    alone = run(Scenario.of(worlds / "other.yaml", "aco-han", options={"ants": 10}, smoothing="none"))
    assert rows[3]["digest"] == alone.rollout.digest
    assert rows[3]["spl"] == alone.metric("spl")
    assert rows[3]["option.ants"] == 10
    assert rows[2]["option.ants"] is None
    assert read_results("out").table.equals(results.table)


def test_what_is_there_is_not_run_again(worlds):
    first = sweep(TWO_BY_TWO, "out", jobs=0)
    before = canonical_bytes("out")
    again = sweep(TWO_BY_TWO, "out", jobs=0)
    assert (first.made, again.made, again.complete) == (4, 0, True)
    assert canonical_bytes("out") == before


@pytest.mark.slow
def test_runs_that_crashed_are_made_again_only_if_asked(tmp_path):
    campaign = make_campaign({"worlds": "empty", "planners": "astar", "seeds": 4})
    expansion = expand(campaign)
    first = sweep(campaign, tmp_path, expansion=expansion, jobs=1, work=Deadly((2,)))
    assert first.outcomes == {"succeeded": 3, "crashed": 1}
    assert sweep(campaign, tmp_path, expansion=expansion, jobs=0, work=Deadly()).made == 0
    again = sweep(campaign, tmp_path, expansion=expansion, jobs=0, work=Deadly(), retry_crashed=True)
    assert (again.made, again.outcomes) == (1, {"succeeded": 4})


@pytest.mark.slow
def test_runs_of_a_planner_or_an_outcome_are_made_again(tmp_path):
    campaign = make_campaign({"worlds": "empty", "planners": ["astar", {"name": "as", "ants": [5, 6]}], "seeds": 2})
    expansion = expand(campaign)

    def again(*words):
        return sweep(campaign, tmp_path, expansion=expansion, jobs=0, work=Deadly(), again=words).made

    assert again() == 6
    sweep(campaign, tmp_path, expansion=expansion, jobs=1, work=Deadly((1,)), again=["as ants=6"])
    assert [again("crashed"), again("crashed"), again("as"), again("as ants=5", "astar"), again()] == [1, 0, 4, 4, 0]
    with pytest.raises(
        InputError, match=r"^--again ants: no such planner or outcome; choose from astar, as ants=5, as"
    ):
        again("ants")


def test_what_is_made_again_takes_the_place_of_the_old_result_and_its_log(tmp_path):
    campaign = {"worlds": "empty", "planners": "astar"}
    (first,) = sweep(campaign, tmp_path, jobs=0, keep="all").table.to_pylist()
    (second,) = sweep(campaign, tmp_path, jobs=0, keep="none", again=["astar"]).table.to_pylist()
    assert (first["digest"], second["rollout"]) == (second["digest"], None)
    assert not (tmp_path / first["rollout"]).exists()


PLANNER = "from antdrive.planners import AStar\n\nclass Mine(AStar):\n    pass\n"


def test_a_corrected_planner_is_run_again_and_said_so(tmp_path):
    broken = PLANNER.replace("pass", "def plan(self, query, rng):\n        return 1 / 0")
    mine = tmp_path / "mine.py"
    campaign = {"worlds": "empty", "planners": ["mine.py:Mine", "astar"]}
    mine.write_text(broken)
    first = sweep(make_campaign(campaign, tmp_path), tmp_path / "out", jobs=0)
    mine.write_text(PLANNER)
    notes = []
    second = sweep(make_campaign(campaign, tmp_path), tmp_path / "out", jobs=0, notify=notes.append)
    assert [first.outcomes, second.outcomes] == [{"planner_fault": 1, "succeeded": 1}, {"succeeded": 2}]
    assert second.made == 1
    (note,) = notes
    assert re.fullmatch(r"1 run of Mine came from mine\.py \w{8}; mine\.py \w{8} repeats them", note)
    copy = second.table["command"][0].as_py().split()[4]
    assert (tmp_path / "out" / copy.rpartition(":")[0]).read_text() == PLANNER


def test_plain_data_may_be_numpys_tuples_ranges_and_paths(worlds):
    planners = ({"name": "as", "ants": np.array([5, 6]), "beta": np.float64(2)}, {"name": "as", "ants": range(7, 9)})
    campaign = {"worlds": (worlds / "small.yaml",), "planners": planners, "seeds": (1, 2), "noise": np.int64(1)}
    plain = {
        "worlds": ["small.yaml"], "seeds": [1, 2], "noise": [1],
        "planners": [{"name": "as", "ants": [5, 6], "beta": 2.0}, {"name": "as", "ants": [7, 8]}],
    }  # fmt: skip
    assert [job.key for job in expand(make_campaign(campaign)).jobs] == [
        job.key for job in expand(make_campaign(plain)).jobs
    ]


@pytest.mark.slow
def test_processes_and_order_do_not_show_in_the_table(worlds):
    sweep(TWO_BY_TWO, "here", jobs=0)
    back = {"worlds": TWO_BY_TWO["worlds"][::-1], "planners": TWO_BY_TWO["planners"][::-1]}
    sweep(back, "back", jobs=2)
    assert canonical_bytes("here") == canonical_bytes("back")


def test_another_campaign_does_not_take_the_place_of_the_first(tmp_path):
    """A campaign that shares no run is refused; one that shares some says what leaves the table."""
    first, notes, work = {"worlds": "empty", "planners": "astar", "seeds": 3}, [], Deadly()
    sweep(first, tmp_path, jobs=0, work=work)
    made = canonical_bytes(tmp_path)
    files = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    for change in ({"worlds": "gate"}, {"margin": 0.05}, {"seeds": [7]}, {"settings": {"cell": 0.1}}):
        with pytest.raises(
            InputError, match=r"contains the 3 runs of another campaign .* use another folder \(--out\)"
        ):
            sweep({**first, **change}, tmp_path, jobs=0, work=work)
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == files
    part = sweep({**first, "seeds": [2, 5]}, tmp_path, jobs=0, work=work, notify=notes.append)
    assert (part.size, part.made) == (2, 1)
    assert [note.split(":")[0] for note in notes] == [
        f"2 runs of the previous campaign (campaign) leave the table of {tmp_path}",
        "seed has no effect",
    ]
    sweep(first, tmp_path, jobs=0, work=work, notify=notes.append)
    assert canonical_bytes(tmp_path) == made


def test_a_folder_from_before_planners_drove_their_own_plans_is_refused_and_resumes_with_its_smoothing(tmp_path):
    campaign = {"worlds": "empty", "planners": ["astar", "tangent"]}
    old = {**campaign, "smoothing": "clearance"}
    assert sweep(old, tmp_path, jobs=0, work=Deadly()).made == 2
    with pytest.raises(
        InputError, match=r"contains 2 runs with smoothing clearance.* add smoothing: clearance to resume"
    ):
        sweep(campaign, tmp_path, jobs=0, work=Deadly())
    assert sweep(old, tmp_path, jobs=0, work=Deadly()).made == 0


def test_runs_of_another_version_are_said(tmp_path, monkeypatch):
    campaign, notes = {"worlds": "empty", "planners": "astar", "seeds": 2}, []
    sweep(campaign, tmp_path, jobs=0, work=Deadly())
    monkeypatch.setattr(sweeping, "versions", lambda: {"antdrive": "9.9"})
    sweep({**campaign, "seeds": 3}, tmp_path, jobs=0, work=Deadly(), notify=notes.append)
    note, _ = notes  # and that seeds have no effect
    assert re.fullmatch(r"2 runs came from antdrive \S+, new ones come from 9\.9; a new folder repeats all", note)


BASE = {"worlds": ["empty", "no-path"], "planners": ["astar"]}


@pytest.mark.parametrize(
    ("raised", "outcome", "reason"),
    [
        (PlannerError("mine", "raised ValueError"), "planner_fault", str(PlannerError("mine", "raised ValueError"))),
        (ZeroDivisionError("oh"), "crashed", "ZeroDivisionError: oh"),
    ],
)
def test_what_a_run_raises_is_its_result(raised, outcome, reason, monkeypatch):
    def fails(scenario, progress):
        raise raised

    monkeypatch.setattr(running, "run", fails)
    row = Driving()(expand(make_campaign(BASE)).jobs[0]).row
    assert (row["outcome"], row["reason"], row["succeeded"], row["certified"]) == (outcome, reason, False, None)


@pytest.mark.parametrize(("keep", "kept"), [("none", 0), ("failed", 0), ("all", 1)])
def test_logs_are_kept_by_rule_and_hold_what_the_row_says(keep, kept, tmp_path):
    rows = sweep({**BASE, "rollouts": keep}, tmp_path, jobs=0).table.to_pylist()
    assert [row["outcome"] for row in rows] == ["succeeded", "no_path"]
    assert [row["certified"] for row in rows] == [True, None]
    assert [row["spl"] is None for row in rows] == [False, True]
    logs = list(tmp_path.rglob("*.npz"))
    assert len(logs) == kept
    if kept:
        assert rows[0]["rollout"] == log_path(rows[0]["key"])
        assert Rollout.load(tmp_path / rows[0]["rollout"]).digest == rows[0]["digest"]


@pytest.mark.parametrize("folder", ["", None])
def test_a_log_that_cannot_be_written_is_no_crash_of_the_run(folder, tmp_path, monkeypatch):
    def full(log, path):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Rollout, "save", full)
    driving = Driving("all", None if folder is None else str(tmp_path))
    with pytest.raises(InputError, match=r"^rollouts/.*\.npz: cannot be written \(No space left on device\)$"):
        driving(expand(make_campaign(BASE)).jobs[0])


def test_a_planner_that_this_machine_lacks_ends_the_campaign(monkeypatch):
    one = expand(make_campaign(BASE)).jobs[0]
    case = dataclasses.replace(one.case, planner=dataclasses.replace(one.case.planner, source="elsewhere"))
    with pytest.raises(InputError, match="no planner is called 'elsewhere'"):
        Driving()(one._replace(case=case))


def test_the_log_of_a_failed_drive_is_kept(tmp_path):
    hit = {
        **BASE,
        "worlds": "empty",
        "settings": {"unseen": [{"x": 3.0, "y": 3.0, "radius": 0.2}]},
        "rollouts": "failed",
    }
    (row,) = sweep(hit, tmp_path, jobs=0).table.to_pylist()
    assert row["outcome"] == "collided"
    assert (tmp_path / row["rollout"]).exists()
    assert "--unseen 3.0,3.0,0.2" in row["command"]


def test_an_auto_margin_is_chosen_once_for_each_robot_and_its_settings(monkeypatch):
    asked = []

    def choose(conditions):
        asked.append((conditions.robot.name, conditions.noise))
        return Calibration(margin=0.07, loss=0.05, largest=0.04, reserve=0.01, probability=1e-3, drives=100, key="k")

    monkeypatch.setattr(sweeping, "choose_margin", choose)
    campaign = {**BASE, "robots": ["turtlebot", "jackal"], "noise": [0, 1], "margin": [0.03, "auto"], "seeds": 2}
    jobs = calibrated(expand(make_campaign(campaign)).jobs)
    assert sorted(asked) == [("jackal", 0.0), ("jackal", 1.0), ("turtlebot", 0.0), ("turtlebot", 1.0)]
    assert len({one.key for one in jobs}) == len(jobs) == 2 * 2 * 2 * 2 * 2
    auto = [one for one in jobs if one.case.resolved.margin == "auto"]
    assert {one.case.scenario(one.seed).margin for one in auto} == {0.07}
    assert all(one.case.scenario(one.seed).chosen is not None for one in auto)
    assert {sweeping.grid_table([one])["margin"][0].as_py() for one in auto} == {0.07}


def test_a_default_margin_is_the_run_with_its_number_and_is_asked_for_as_the_default():
    campaign = {**BASE, "worlds": ["empty"], "robots": ["turtlebot", "jackal"], "noise": [0, 1], "smoothing": ["none"]}
    jobs = expand(make_campaign(campaign)).jobs
    rows = [(one.case.robot.name, one.case.resolved.columns["noise"], *_margins(one)) for one in jobs]
    assert sorted(rows) == [
        ("jackal", 0, "default", 0.03), ("jackal", 1, "default", 0.057),
        ("turtlebot", 0, "default", 0.03), ("turtlebot", 1, "default", 0.076),
    ]  # fmt: skip
    same = [(robot, noise, number) for robot, noise, _, number in rows]
    for one, (robot, noise, number) in zip(jobs, same, strict=True):
        given = {**campaign, "robots": [robot], "noise": [noise], "margin": [number]}
        assert {other.key for other in expand(make_campaign(given)).jobs} >= {one.key}
    assert len(expand(make_campaign({**campaign, "noise": [0], "margin": [None, 0.03]})).jobs) == 2


def _margins(job):
    row = sweeping.grid_table([job])
    return row["margin_asked"][0].as_py(), row["margin"][0].as_py()


def test_a_robot_of_ones_own_comes_along_with_the_folder(tmp_path):
    source = tmp_path / "mine.yaml"
    catalogue = Path(job.__file__).parents[2] / "robots" / "catalog" / "turtlebot.yaml"
    source.write_text(catalogue.read_text().replace("mass: ", "mass: 1"))
    save_task(load_task("empty"), tmp_path / "w.yaml")
    campaign = make_campaign({"worlds": "w.yaml", "planners": "astar", "robots": "mine.yaml"}, tmp_path)
    (row,) = sweep(campaign, tmp_path / "out", jobs=0).table.to_pylist()
    word = row["command"].split("--robot ")[1].split()[0]
    assert load_robot(tmp_path / "out" / word) == load_robot(source)
