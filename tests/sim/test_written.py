"""Scenarios in words: written to commands, files and records, and read again as the same."""

import dataclasses
import json
import shlex

import pytest
import typer
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.base.errors import FieldError, InputError
from antdrive.cli import options
from antdrive.cli.scenario_options import Ends, Setup
from antdrive.planners import AStar, load_planner
from antdrive.robots import list_robots
from antdrive.sim import Scenario, run
from antdrive.sim.log.record import DriveRecord, settings_of
from antdrive.sim.recorded import command_of, false_words, written_of
from antdrive.sim.settings import LOCALISATIONS, SETTINGS, SMOOTHINGS
from antdrive.sim.written import Written
from antdrive.worlds import load_task

METRES = st.floats(0.001, 1.0).map(lambda value: round(value, 6))
OF = {
    "smoothing": st.sampled_from(SMOOTHINGS),
    "noise": st.floats(0, 2).map(lambda value: round(value, 6)),
    "margin": METRES | st.just("auto"),
    "cell": METRES,
    "footprint": st.sampled_from(["auto", "disc"]),
    "map": st.just("given"),
    "localisation": st.sampled_from(sorted({*LOCALISATIONS} - {"matching"})),
    "odometry": METRES,
    "controller": st.fixed_dictionaries({"lookahead_time": METRES}),
    "sees": st.sampled_from(["positions", "velocities:2.5", "motions"]),
    "avoid": st.just(False) | st.just("none"),
    "replan": st.just(False),
    "unseen": st.lists(
        st.fixed_dictionaries({"x": st.just(3.0), "y": METRES, "radius": METRES}), min_size=1, max_size=2
    ),
    "time_limit": METRES,
}
GIVEN = st.fixed_dictionaries({}, optional=OF)
OPTIONS = st.fixed_dictionaries({}, optional={"ants": st.integers(1, 99), "evaporation": METRES})
WORDS = st.builds(
    Written,
    world=st.sampled_from(["forest", "empty"]),
    start=st.none() | st.just([1.5, 1.5, 0.25]),
    goal=st.none() | st.just([4.0, 3.0]),
    planner=st.just("aco-han"),
    options=OPTIONS,
    robot=st.sampled_from(["turtlebot", "jackal"]),
    settings=GIVEN,
    seed=st.integers(0, 2**63 - 1),
)
PLAIN = Written(world="forest", planner="aco-han")


@given(WORDS)
def test_plain_data_is_read_as_the_same_words(words):
    assert Written.read(json.loads(json.dumps(words.plain()))) == words


@given(WORDS)
@settings(max_examples=25)
def test_a_scenario_keeps_the_words_that_it_was_made_of(words):
    s = Scenario.read(words)
    again = Scenario.read(s.written)
    assert again == s
    assert again.key == s.key


def scenario_of_arguments(arguments):
    """Return the scenario that `antdrive run` would drive for its arguments."""
    read = []

    @options.with_settings(name for name, one in SETTINGS.items() if one.flag)
    def reading(*, world: options.World, setup: Setup, ends: Ends, **given):
        read.append(setup.scenario(ends.of(world), given))

    app = typer.Typer()
    app.command()(reading)
    typer.main.get_command(app).main(arguments, standalone_mode=False)
    return read[-1]


@given(WORDS)
@settings(max_examples=15)
def test_a_command_is_parsed_to_the_same_scenario(words):
    words = Written(**{**vars(words), "settings": {**words.settings, "margin": 0.1}})
    command = words.command()
    if command is None:
        assert words.settings.get("avoid") == "none"
    else:
        assert scenario_of_arguments(shlex.split(command)[2:]) == Scenario.read(words)


@given(st.sampled_from(sorted(OF)), st.data())
def test_the_key_differs_with_every_setting(name, data):
    usual, s = Scenario.read(PLAIN), Scenario.read(Written(**{**vars(PLAIN), "settings": {name: data.draw(OF[name])}}))
    assert (s.key == usual.key) == (s == usual)


@pytest.mark.parametrize(
    "other",
    [
        {"seed": 1},
        {"world": "empty"},
        {"robot": "jackal"},
        {"planner": "as"},
        {"options": {"ants": 3}},
        {"goal": [4, 4]},
    ],
)
def test_the_key_differs_with_every_other_word(other):
    assert Scenario.read(Written(**{**vars(PLAIN), **other})).key != Scenario.read(PLAIN).key


def test_the_key_of_a_scenario_is_that_of_its_run_in_a_campaign():
    from antdrive.runs.campaigns.campaign import make_campaign
    from antdrive.runs.campaigns.expanding import expand

    data = {"worlds": "forest", "planners": {"name": "aco-han", "ants": 3}, "noise": 1.0, "seeds": [4]}
    (job,) = expand(make_campaign(data)).jobs
    assert job.key == Scenario.of("forest", "aco-han", options={"ants": 3}, noise=1.0, seed=4).key
    assert job.key == "1a28ffe7640dffa2916b157f85401910", "as in folders written before"


def test_a_planner_is_named_as_older_suites_do():
    old = [{"file": "mine.py", "name": "Mine", "width": 2}, {"module": "mine", "name": "Mine", "width": 2}]
    words = [Written.read({"world": "box.yaml", "planner": planner}) for planner in old]
    assert [(one.planner, one.options) for one in words] == [
        ("mine.py:Mine", {"width": 2}),
        ("mine:Mine", {"width": 2}),
    ]
    of_today = Written.read({"world": "box.yaml", "planner": {"name": "mine.py:Mine", "file": "a.txt"}})
    assert (of_today.planner, of_today.options) == ("mine.py:Mine", {"file": "a.txt"})


def test_parts_made_in_python_are_files_named_after_them():
    task = load_task("forest")
    s = Scenario(task=task, planner=AStar(), robot=Scenario.of("forest").robot)
    assert s.written == Written(
        world="forest", planner="FILE.py:AStar", robot="turtlebot", options=settings_of(AStar())
    )
    named = Scenario.of(task, load_planner("aco-han", ants=7), seed=2)
    assert named.written.seed == 2


def test_words_of_a_part_that_was_replaced_do_not_count():
    s = Scenario.of("forest", "astar")
    moved = dataclasses.replace(s, task=dataclasses.replace(s.task, goal=(4.0, 3.0)))
    assert moved.written.goal == [4.0, 3.0]
    assert dataclasses.replace(s, noise=1.0).written == dataclasses.replace(s.written, settings={"noise": 1.0})


@pytest.mark.parametrize(
    ("words", "key"),
    [
        ({"world": "emty"}, "world"),
        ({"robot": "jakal"}, "robot"),
        ({"planner": "astarr"}, "planner"),
        ({"planner": {"name": "as", "antss": 3}}, "planner.antss"),
        ({"goal": [-1, 0]}, "goal"),
        ({"noise": -1.0}, "noise"),
        ({"world": {"generate": "forest", "seed": -1}}, "world.seed"),
        ({"nois": 1}, "nois"),
        ({"start": [1, 2]}, "start"),
        ({"seed": "one"}, "seed"),
    ],
)
def test_an_error_has_the_place_of_its_key(words, key):
    def at(key, problem):
        return InputError(f"here.{key}")

    with pytest.raises((InputError, ValueError)) as said:
        Scenario.read(Written.read({"world": "forest", "planner": "astar", **words}), at=at)
    assert getattr(said.value, "key", "") == key or str(said.value) == f"here.{key}"


@pytest.mark.parametrize(
    "words",
    [{}, {"world": 5}, {"world": {"size": 3}}, {"world": "a", "unseen": 5}, {"world": "a", "sees": 5},
     {"world": "a", "goal": ["x", 1]}, {"world": "a", "seed": "1"},
     {"world": "a", "planner": 5}, {"world": "a", "avoid": 7}, {"world": "a", "odd": 1}],
)  # fmt: skip
def test_a_log_with_words_that_are_none_has_no_command(small_run, words):
    record = dataclasses.replace(small_run.rollout.record, written=words)
    with pytest.raises(FieldError):
        written_of(record)
    assert command_of(record) is None
    assert len(list(false_words(record))) == 1


def test_a_log_names_the_files_that_its_drive_was_given(tmp_path, monkeypatch):
    (tmp_path / "robot.yaml").write_text(list_robots()["jackal"].read_text())
    monkeypatch.chdir(tmp_path)
    words = Written(world="empty", planner="astar", robot="robot.yaml", settings={"margin": 0.1})
    s = Scenario.read(words, tmp_path)
    record = run(dataclasses.replace(s, time_limit=0.5)).rollout.record
    read = DriveRecord.from_json(dataclasses.replace(record, digest="0").to_json())
    assert (
        command_of(read)
        == "antdrive run empty --planner astar --robot robot.yaml --margin 0.1 --time-limit 0.5 --seed 0"
    )


FORGED = {
    "world": {"world": "office"},
    "start": {"start": [1.5, 1.5, 1.0]},
    "goal": {"world": "mine.yaml", "goal": [1.5, 2.5]},
    "robot": {"robot": "jackal"},
    "planner": {"planner": "mine.py:Mine", "options": {}},
    "planner.ants": {"options": {"ants": 7}},
    "seed": {"seed": 5},
    "noise": {"settings": {"noise": 0.5}},
    "margin": {"settings": {"margin": "auto"}},
}


@pytest.mark.parametrize("key", FORGED)
def test_a_written_word_that_the_record_contradicts_is_named(key, small_run):
    record = small_run.rollout.record
    assert [*false_words(record, settings=True)] == []
    forged = dataclasses.replace(record, written=dataclasses.replace(written_of(record), **FORGED[key]).plain())
    assert f"record.written.{key}:" in " ".join(false_words(forged, settings=True))
    assert command_of(forged) is None


def test_a_mapless_drive_contradicts_no_word_of_its_own():
    s = Scenario.of("slalom", "dstar-lite", map="none", localisation="odometry", time_limit=0.5)
    assert [*false_words(run(s).rollout.record, settings=True)] == []


def test_settings_that_only_movers_bring_to_bear_are_unknown_without_any():
    s = Scenario.of("empty", "astar", localisation="odometry", replanning=None, avoidance=None, time_limit=0.5)
    assert [*false_words(run(s).rollout.record, settings=True)] == []
