"""What every command shares: help, exit codes, streams, interruptions."""

import json
import os
import re
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from antdrive.base.kernel_cache import COMPILING
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
        function = command.function(name)
        assert (function.__doc__ or "").split("\n")[0] == command.summary


def every_command(command, words=()):
    """The words of all commands, groups first."""
    yield words
    for name, inner in getattr(command, "commands", {}).items():
        yield from every_command(inner, (*words, name))


def test_the_help_of_every_command_is_as_recorded(antdrive, monkeypatch, file_regression):
    monkeypatch.setenv("COLUMNS", "80")
    texts = [antdrive(*words, "--help") for words in every_command(application())]
    assert {(code, err) for code, _, err in texts} == {(0, "")}
    told = "\n".join(out for _, out, _ in texts)
    assert [line for line in told.splitlines() if len(line) > 80] == []
    file_regression.check(told, basename="help")


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
    assert re.fullmatch(r"antdrive 0\.\S+ \(pybullet 3\.\S+( \(pybullet-arm64\))?, python 3\.\S+\)\n", out)


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


@pytest.mark.slow
def test_python_m_antdrive_is_the_command_and_prints_nothing_else(small, tmp_path):
    command = [sys.executable, "-m", "antdrive", "run", str(small), "--json", "--out", str(tmp_path / "r")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert [line for line in done.stderr.splitlines() if COMPILING not in line] == []
    assert json.loads(done.stdout)["succeeded"]


def in_a_shell(line):
    """Exit code, stdout and stderr of a line of a shell, in which $A is the command."""
    env = {**os.environ, "A": f"{sys.executable} -m antdrive"}
    done = subprocess.run(["bash", "-c", line], capture_output=True, text=True, env=env, check=False)
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize(
    ("line", "code", "says"),
    [
        ("$A planners | true; exit ${PIPESTATUS[0]}", BROKEN_PIPE, ""),
        ("$A planners >&-", 2, "antdrive: stdout: cannot be written (Bad file descriptor)\n"),
        ("$A planners --json >/dev/full", 2, "antdrive: stdout: cannot be written (No space left on device)\n"),
        ("$A --help >/dev/full", 2, "antdrive: stdout: cannot be written (No space left on device)\n"),
        ("$A planners --bogus 2>&-", 2, ""),
        ("$A planners --bogus 2>/dev/full", 2, ""),
        ("$A planners --bogus 2> >(true)", 2, ""),
        ("$A planners --bogus <&- >&- 2>&-", 2, ""),
    ],
)
def test_a_stream_that_takes_nothing_is_one_line(line, code, says):
    assert in_a_shell(line) == (code, "", says)


def test_a_stream_in_a_code_page_gets_other_characters_as_escapes(small):
    small.write_text(small.read_text(encoding="utf-8").replace("name: small", "name: Ж"), encoding="utf-8")
    code, out, err = in_a_shell(f"PYTHONIOENCODING=cp1252 $A worlds show {small}")
    assert (code, err) == (0, "")
    assert r"\u0416" in out


@pytest.mark.slow
def test_a_result_is_not_lost_with_stderr_and_no_file_takes_a_streams_number(small, tmp_path):
    """A compiled library prints to number 1 or 2, whatever file that is."""
    line = f"$A run {small} --no-figures --json --out {tmp_path / 'r'}"
    code, out, _ = in_a_shell(f"{line} 2>&-")
    assert (code, json.loads(out)["succeeded"]) == (0, True)
    code, _, err = in_a_shell(f"{line} >&-")
    assert (code, err) == (2, "antdrive: stdout: cannot be written (Bad file descriptor)\n")
    assert json.loads((tmp_path / "r" / "result.json").read_text())["succeeded"]
    assert in_a_shell(f"$A verify {tmp_path / 'r'} 2>&-")[0] == 0


def test_another_closed_pipe_is_a_fault(antdrive, monkeypatch):
    def closed(*_, **__):
        raise BrokenPipeError(32, "Broken pipe")

    monkeypatch.setattr("antdrive.sim.pipeline.run", closed)
    code, _, err = antdrive("run", "empty")
    assert (code, err.startswith("antdrive: internal error: BrokenPipeError: ")) == (3, True)


@pytest.mark.parametrize(
    ("number", "code", "says"),
    [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated"), (signal.SIGHUP, 129, "terminated")],
)
def test_a_signal_is_one_line_that_says_how_to_resume(signals, antdrive, monkeypatch, number, code, says):
    def interrupt(*_, **__):
        signal.raise_signal(number)

    monkeypatch.setattr("antdrive.sim.pipeline.run", interrupt)
    monkeypatch.setattr("antdrive.runs.campaigns.sweeping.sweep", interrupt)
    assert antdrive("run", "empty")[::2] == (code, f"antdrive: {says}\n")
    words = ["--world", "empty", "--planner", "astar", "-o", "a b"]
    again = "antdrive sweep --world empty --planner astar -o 'a b'"
    assert antdrive("sweep", *words, "--again", "astar")[::2] == (
        code, f"antdrive: {says}; completed runs are kept, resume with: {again}\n"
    )  # fmt: skip


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
    assert (code, out, last.split(";")[0]) == (130, "", "antdrive: interrupted")
    assert len(notes) == (words[0] == "reproduce"), "one seed is too few for its claims, it says"
    assert not list((tmp_path / "out").rglob("*.*"))


def test_a_full_disk_is_one_line(refused, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device", "w.yaml")

    monkeypatch.setattr("antdrive.worlds.save_task", full)
    assert refused("worlds", "generate", "forest", "-o", "w.yaml") == (
        "antdrive: w.yaml: cannot be written (No space left on device)\n"
    )


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


def test_a_plan_names_an_own_planner_as_drives_do(antdrive, small):
    Path("own.py").write_text("from antdrive.planners import AStar\nclass Own(AStar): pass\n")
    code, out, err = antdrive("plan", small, "-p", "own.py:Own")
    assert (code, err) == (0, "")
    assert out.startswith("small: Own found a path\n")


def test_the_help_explains_the_exit_codes(antdrive):
    words = " ".join(antdrive("--help")[1].split())
    for code in ("0: success", "1: failed drive", "2: invalid input", "3: planner error", "--debug"):
        assert code in words
