"""Commands that reports take from the records of logs."""

import shlex
from dataclasses import replace

import pytest

from antdrive.planners import load_planner
from antdrive.robots import load_robot
from antdrive.sim import Rollout, Scenario, run
from antdrive.sim.recorded import command_of
from antdrive.worlds import Disc, load_task, save_task
from tests.records import changed


@pytest.mark.parametrize("world", ["empty", "own"])
def test_the_command_of_a_log_repeats_its_drive(antdrive, tmp_path, world):
    task = replace(load_task("empty"), goal=(4.0, 3.0))
    if world == "own":
        task = changed(task, "world", name="own", obstacles=(Disc(3.0, 4.5, 0.2),))
        save_task(task, "own.yaml")
    planner = load_planner("aco-han", ants="7", iterations="3")
    given = {"noise": 1.0, "seed": 3, "margin": 0.05, "smoothing": "none", "time_limit": 1.5}
    log = run(Scenario(task=task, planner=planner, planner_name="aco-han", robot=load_robot("jackal"), **given)).rollout
    command = command_of(log.record)
    assert command.startswith(
        f"antdrive run {'empty --goal=4,3' if world == 'empty' else 'own.yaml'} --planner aco-han"
    )
    antdrive(*shlex.split(command)[1:], "--no-figures", "--out", tmp_path / "again")
    assert Rollout.load(tmp_path / "again" / "rollout.npz").digest == log.digest


def test_a_command_names_settings_that_differ_from_the_defaults_alone(small_run):
    log = small_run.rollout
    assert command_of(log.record) == "antdrive run small.yaml --planner astar --robot turtlebot --seed 0"
    old = replace(log.record, written=None)
    assert command_of(old).startswith(
        "antdrive run small.yaml --planner astar --robot turtlebot --margin 0.03 --cell 0.2"
    )
    odd = replace(old, planner=replace(log.record.planner, name="Own; rm"))
    assert "--planner 'FILE.py:Own; rm'" in command_of(odd)
    assert command_of(replace(old, controller=replace(log.record.controller, settings={"speed": 1.0}))) is None
    assert command_of(replace(old, control_hz=120)) is None, "antdrive run has no option for it"


def test_escape_codes_are_spelled_out_on_the_terminal(capsys):
    from antdrive.cli.console import print_error, print_line

    print_line("a\x1b[31mred\u202e\tb")
    print_error("c\x07\x9b")
    out, err = capsys.readouterr()
    assert out == "a\\x1b[31mred\\u202e\tb\n"
    assert err == "antdrive: c\\x07\\x9b\n"
