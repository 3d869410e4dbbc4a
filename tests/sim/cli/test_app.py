"""What every command shares: help, exit codes, streams, interruptions."""

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer

from antdrive.planners import Progress, watch
from antdrive.sim.cli.app import COMMANDS, WORLDS, application
from tests.sim.cli.calling import Call, Refused


def test_help_lists_every_command_with_a_complete_line(antdrive: Call) -> None:
    for group, commands in (([], COMMANDS), (["worlds"], WORLDS)):
        code, out, _ = antdrive(*group, "--help")
        assert code == 0
        listed = dict(re.findall(r"^  ([a-z-]+) {2,}(\S.*)$", out.split("Commands:")[1], flags=re.MULTILINE))
        for name in commands:
            assert listed[name].endswith("."), listed[name]
            assert not listed[name].endswith("...")


@pytest.mark.parametrize("name", [*COMMANDS, *(f"worlds {name}" for name in WORLDS)])
def test_every_option_is_explained_with_its_unit(name: str) -> None:
    command: Any = typer.main.get_command(application())
    for word in name.split():
        command = command.commands[word]
    for param in command.params:
        unit = {"METRES": "[m]", "SECONDS": "[s]", "SPEED": "[m/s]"}.get(param.metavar or "", "")
        assert param.help, f"{name} {param.name}"
        assert unit in param.help, f"{name} {param.name}: {param.help}"


def test_the_version_is_shown(antdrive: Call) -> None:
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
def test_a_wrong_word_is_one_line_that_names_the_help(refused: Refused, words: list[str], says: str) -> None:
    assert says in refused(*words)


def test_python_m_antdrive_is_the_command_and_prints_nothing_else(small: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "antdrive", "run", str(small), "--json", "--out", str(tmp_path / "r")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert done.stderr == ""
    assert json.loads(done.stdout)["succeeded"]


def test_ctrl_c_is_one_line(antdrive: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object, **__: object) -> None:
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
        ["reproduce", "lee2008", "--seeds", "1"],
    ],
    ids=lambda words: words[0],
)
def test_ctrl_c_while_planning_ends_a_command_that_plans_many_times(
    antdrive: Call, small: Path, tmp_path: Path, words: list[str]
) -> None:
    def stop(progress: Progress) -> None:
        raise KeyboardInterrupt

    with watch(stop):
        code, out, err = antdrive(*(str(small) if word == "WORLD" else word for word in words))
    assert (code, out, err) == (130, "", "antdrive: interrupted\n")
    assert not list((tmp_path / "out").rglob("*.*"))


def test_a_full_disk_is_one_line(refused: Refused, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device", "w.yaml")

    monkeypatch.setattr("antdrive.worlds.save_task", full)
    assert refused("worlds", "generate", "forest", "-o", "w.yaml") == "antdrive: w.yaml: No space left on device\n"
