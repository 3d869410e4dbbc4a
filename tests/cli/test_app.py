"""What every command shares: help, exit codes, streams, interruptions."""

import importlib
import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from antdrive.cli.commands import COMMANDS, ROBOTS, WORLDS
from antdrive.cli.exits import BROKEN_PIPE
from antdrive.cli.groups import application
from antdrive.planners import PLANNERS, on_progress


@pytest.mark.parametrize(("group", "table"), [([], COMMANDS), (["worlds"], WORLDS), (["robots"], ROBOTS)])
def test_help_lists_every_command_with_the_first_line_of_its_own(antdrive, group, table):
    code, out, _ = antdrive(*group, "--help")
    assert code == 0
    listed = dict(re.findall(r"^  ([a-z-]+) {2,}(\S.*)$", out.split("Commands:")[1], flags=re.MULTILINE))
    for name, command in table.items():
        assert listed[name] == command.summary
        function = getattr(importlib.import_module(f"antdrive.cli.commands.{command.module}"), command.function)
        assert (function.__doc__ or "").split("\n")[0] == command.summary


@pytest.mark.parametrize("name", [*COMMANDS, *(f"worlds {name}" for name in WORLDS)])
def test_every_option_is_explained_with_its_unit(name):
    command = application()
    for word in name.split():
        command = command.commands[word]
    for param in command.params:
        unit = {"METRES": "[m]", "SECONDS": "[s]", "SPEED": "[m/s]"}.get(param.metavar or "", "")
        assert param.help, f"{name} {param.name}"
        assert unit in param.help, f"{name} {param.name}: {param.help}"


def test_the_version_is_shown(antdrive):
    code, out, err = antdrive("--version")
    assert (code, err) == (0, "")
    assert out.startswith("antdrive 0.")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["run"], "Missing argument 'WORLD'"),
        (["rum", "empty"], "Did you mean 'run'"),
        (["run", "empty", "--bogus"], "(see antdrive run --help)"),
        (["worlds", "show"], "(see antdrive worlds show --help)"),
        (["nothing"], "(see antdrive --help)"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_a_wrong_word_is_one_line_that_names_the_help(refused, words, says):
    assert says in refused(*words)


def test_python_m_antdrive_is_the_command_and_prints_nothing_else(small, tmp_path):
    command = [sys.executable, "-m", "antdrive", "run", str(small), "--json", "--out", str(tmp_path / "r")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert [line for line in done.stderr.splitlines() if "compiling the planners, once" not in line] == []
    assert json.loads(done.stdout)["succeeded"]


@pytest.mark.parametrize("closed", ["stdout", "stderr"])
def test_a_closed_pipe_ends_the_program_silently(closed):
    """As in `antdrive planners | head`, and with an error that nobody reads."""
    words = ["planners"] if closed == "stdout" else ["planners", "--bogus"]
    reading, writing = os.pipe()
    os.close(reading)
    other = "stderr" if closed == "stdout" else "stdout"
    command = [sys.executable, "-m", "antdrive", *words]
    streams: dict[str, int] = {closed: writing, other: subprocess.PIPE}
    done = subprocess.run(command, check=False, **streams)
    os.close(writing)
    assert (done.returncode, getattr(done, other)) == (BROKEN_PIPE, b"")


def test_another_closed_pipe_is_a_fault(antdrive, monkeypatch):
    def closed(*_, **__):
        raise BrokenPipeError(32, "Broken pipe")

    monkeypatch.setattr("antdrive.sim.pipeline.run", closed)
    code, _, err = antdrive("run", "empty")
    assert (code, err.startswith("antdrive: internal error: BrokenPipeError: ")) == (3, True)


def test_ctrl_c_is_one_line(antdrive, monkeypatch):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("antdrive.sim.pipeline.run", interrupt)
    code, _, err = antdrive("run", "empty")
    assert code == 130
    assert err == "antdrive: interrupted\n"


@pytest.mark.parametrize(
    "words",
    [
        ["compare", "WORLD", "-p", "aco-han", "-p", "astar"],
        ["find-margin", "WORLD", "-p", "aco-han", "--seeds", "1"],
        ["reproduce", "lee2008", "--seeds", "1", "--jobs", "1"],
    ],
    ids=lambda words: words[0],
)
def test_ctrl_c_while_planning_ends_a_command_that_plans_many_times(antdrive, small, tmp_path, words):
    def stop(progress):
        raise KeyboardInterrupt

    with on_progress(stop):
        code, out, err = antdrive(*(str(small) if word == "WORLD" else word for word in words))
    *notes, last = err.splitlines()
    assert (code, out, last) == (130, "", "antdrive: interrupted")
    assert len(notes) == (words[0] == "reproduce"), "one seed is too few for its claims, it says"
    assert not list((tmp_path / "out").rglob("*.*"))


def test_a_full_disk_is_one_line(refused, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device", "w.yaml")

    monkeypatch.setattr("antdrive.worlds.save_task", full)
    assert refused("worlds", "generate", "forest", "-o", "w.yaml") == "antdrive: w.yaml: No space left on device\n"


class Faulty:
    """A planner of somebody else that gets it wrong."""

    def __init__(self, answer):
        self.answer = answer

    def plan(self, query, rng):
        if isinstance(self.answer, Exception):
            raise self.answer
        right = PLANNERS["astar"].plan(query, rng)
        return self.answer(right) if callable(self.answer) else self.answer


@pytest.fixture
def faulty(monkeypatch):
    """Make a planner `mine` known that answers so, or raises."""

    def install(answer):
        monkeypatch.setattr("antdrive.planners.registry.PLANNERS", {**PLANNERS, "mine": Faulty(answer)})

    return install


@pytest.mark.parametrize("command", ["run", "plan"])
@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (ZeroDivisionError("by zero"), r"raised ZeroDivisionError: by zero \(test_app\.py:\d+\)"),
        (ValueError(), r"raised ValueError \(test_app\.py:\d+\)"),
        (OSError(2, "No such file", "x"), r"raised FileNotFoundError: .* \(test_app\.py:\d+\)"),
        (None, r"returned None instead of a PlanResult \(test_app\.py:\d+\)"),
    ],
    ids=["ZeroDivisionError", "ValueError", "OSError", "None"],
)
def test_a_fault_of_a_planner_is_one_line_with_exit_code_3(antdrive, small, faulty, command, answer, says):
    faulty(answer)
    code, out, err = antdrive(command, small, "-p", "mine")
    assert (code, out) == (3, "")
    assert re.fullmatch(rf"antdrive: planner mine {says} \(run again with --debug for the traceback\)\n", err)


@pytest.mark.parametrize("place", [0, 4])
def test_debug_shows_the_traceback_wherever_it_stands(antdrive, small, faulty, place):
    faulty(ZeroDivisionError("by zero"))
    words: list[str | Path] = ["run", small, "-p", "mine"]
    words.insert(place, "--debug")
    code, _, err = antdrive(*words)
    assert code == 3
    assert err.startswith("Traceback")
    assert re.fullmatch(r"antdrive: planner mine raised ZeroDivisionError: .*:\d+\)", err.splitlines()[-1])


def test_any_other_exception_is_one_line_with_exit_code_3(antdrive, monkeypatch):
    def fail(*_, **__):
        raise ValueError("two\nlines")

    monkeypatch.setattr("antdrive.sim.pipeline.plan", fail)
    code, out, err = antdrive("run", "empty")
    assert (code, out) == (3, "")
    assert err == r"antdrive: internal error: ValueError: two\nlines (run again with --debug for the traceback)" + "\n"


def test_a_wrong_plan_is_an_outcome_and_is_not_driven(antdrive, small, faulty):
    faulty(lambda right: replace(right, cells=np.delete(right.cells, 2, axis=0)))
    code, out, err = antdrive("run", small, "-p", "mine", "--json", "-o", "r")
    result = json.loads(out)
    assert (code, err, result["outcome"], result["digest"]) == (1, "", "invalid_plan", None)
    assert result["reason"].startswith("cells: step 1 from ")
    assert not Path("r/rollout.npz").exists()
    code, out, err = antdrive("plan", small, "-p", "mine")
    assert (code, err) == (1, "")
    assert "mine returned an invalid plan (cells: step 1 from " in out


def test_the_help_explains_the_exit_codes(antdrive):
    words = " ".join(antdrive("--help")[1].split())
    for code in ("0: success", "1: failed drive", "2: invalid input", "3: planner error", "--debug"):
        assert code in words
