"""A fresh installation compiles its kernels once, where people can see it."""

import sys

import pytest

from antdrive.cli.compiling import compile_once
from tests.cli.calling import Call


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)


@pytest.mark.usefixtures("terminal")
def test_the_first_call_compiles_and_the_second_does_not(compiled: list[str]) -> None:
    compile_once()
    compile_once()
    assert compiled == ["all"]


def test_without_a_terminal_a_line_says_why_it_takes_a_while(
    compiled: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    compile_once()
    compile_once()
    assert compiled == ["all"]
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("compiling the planners, once for this installation") == 1


@pytest.mark.usefixtures("terminal")
def test_nothing_is_compiled_where_no_cache_can_be_kept(compiled: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("antdrive.base.kernel_cache.cache_folder", lambda: None)
    compile_once()
    assert compiled == []


@pytest.mark.parametrize("command", ["run", "plan", "compare", "find-margin", "reproduce"])
def test_commands_that_plan_compile_first(antdrive: Call, monkeypatch: pytest.MonkeyPatch, command: str) -> None:
    class Compiled(BaseException):  # which no command turns into a message
        pass

    def stop() -> None:
        raise Compiled

    words = {"compare": ["empty", "-p", "astar", "-p", "dijkstra"], "reproduce": ["lee2008"]}.get(command, ["empty"])
    module = f"antdrive.cli.commands.{command.replace('-', '_')}.compile_once"
    monkeypatch.setattr(module, stop)
    with pytest.raises(Compiled):
        antdrive(command, *words)


@pytest.mark.parametrize("words", [["planners"], ["robots"], ["worlds", "show", "empty"], ["schema"]], ids=" ".join)
@pytest.mark.usefixtures("terminal")
def test_commands_that_only_look_do_not_compile(antdrive: Call, compiled: list[str], words: list[str]) -> None:
    assert antdrive(*words)[0] == 0
    assert compiled == []
