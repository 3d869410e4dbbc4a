"""A fresh installation compiles its kernels once, where people can see it."""

import sys

import pytest

from antdrive.cli.compiling import TOGETHER, compile_once
from antdrive.planners import PLANNERS


@pytest.fixture
def terminal(monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)


@pytest.mark.usefixtures("terminal")
def test_the_first_call_compiles_and_the_second_does_not(compiled):
    compile_once()
    compile_once()
    assert compiled == ["all"]


def test_without_a_terminal_a_line_says_why_it_takes_a_while(compiled, capsys):
    compile_once()
    compile_once()
    assert compiled == ["all"]
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("compiling the planners, once per installation") == 1


@pytest.mark.usefixtures("terminal")
def test_nothing_is_compiled_where_no_cache_can_be_kept(compiled, monkeypatch):
    monkeypatch.setattr("antdrive.base.kernel_cache.cache_folder", lambda: None)
    compile_once()
    assert compiled == []


@pytest.mark.parametrize("command", ["run", "plan", "compare", "find-margin", "reproduce"])
def test_commands_that_plan_compile_first(antdrive, monkeypatch, command):
    class Compiled(BaseException):  # which no command turns into a message
        pass

    def stop():
        raise Compiled

    words = {"compare": ["empty", "-p", "astar", "-p", "dijkstra"], "reproduce": ["lee2008"]}.get(command, ["empty"])
    monkeypatch.setattr("antdrive.cli.compiling.is_warm", stop)
    with pytest.raises(Compiled):
        antdrive(command, *words)


@pytest.mark.parametrize("words", [["planners"], ["robots"], ["worlds", "show", "empty"], ["schema"]], ids=" ".join)
@pytest.mark.usefixtures("terminal")
def test_commands_that_only_look_do_not_compile(antdrive, compiled, words):
    assert antdrive(*words)[0] == 0
    assert compiled == []


def test_warm_compiles_on_request_and_once(antdrive, compiled):
    assert antdrive("warm") == (0, "all planners are compiled\n", "")
    assert antdrive("warm") == (0, "all planners are already compiled\n", "")
    assert compiled == ["all"]


def test_without_a_folder_for_the_cache_warm_is_refused(refused, compiled, monkeypatch):
    monkeypatch.setattr("antdrive.base.kernel_cache.cache_folder", lambda: None)
    assert "NUMBA_CACHE_DIR" in refused("warm")
    assert compiled == []


def test_each_group_of_planners_is_known_and_none_is_compiled_twice():
    names = [name for group in TOGETHER for name in group]
    assert set(names) <= set(PLANNERS)
    assert len(set(names)) == len(names)
