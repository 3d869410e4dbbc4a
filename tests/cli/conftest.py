"""Calling the command line in this process, in an empty folder."""

import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from antdrive.cli.app import main
from antdrive.sim import Run
from antdrive.worlds import save_task
from tests.cli.calling import Call, Refused


@pytest.fixture
def antdrive(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path, request: pytest.FixtureRequest
) -> Iterator[Call]:
    """Call `antdrive` with some words: its exit code, stdout and stderr. The report of a failed test shows how calls ended."""
    monkeypatch.chdir(tmp_path)
    before = signal.getsignal(signal.SIGTERM)

    def call(*words: str | Path) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["antdrive", *map(str, words)])
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = capsys.readouterr()
        code = int(ended.value.code or 0)
        request.node.add_report_section("call", f"antdrive {words[0] if words else ''}", f"exit code {code}\n{err}")
        return code, out, err

    yield call
    signal.signal(signal.SIGTERM, before)  # `main` has set its own, which would fail a later test instead of ending all


@pytest.fixture
def refused(antdrive: Call) -> Refused:
    """Call `antdrive` with wrong words, which must end with exit code 2 and one line on stderr: that line."""

    def call(*words: str | Path) -> str:
        code, out, err = antdrive(*words)
        assert (code, out, err.count("\n")) == (2, "", 1), (code, out, err)
        assert err.startswith("antdrive: ")
        return err

    return call


@pytest.fixture
def small(small_run: Run, tmp_path: Path) -> Path:
    """The file of a small world that is quick to drive."""
    path = tmp_path / "small.yaml"
    save_task(small_run.scenario.task, path)
    return path


@pytest.fixture
def compiled(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What was compiled: nothing at first, and nothing is cached yet. Compiling itself is left out."""
    done: list[str] = []

    def warm(jobs: int = -1, progress: Callable[[float], None] | None = None) -> None:
        assert progress is not None
        progress(1.0)
        done.append("all")

    monkeypatch.setattr("antdrive.cli.warm.warm", warm)
    monkeypatch.setattr("antdrive.cli.warm.is_warm", lambda: bool(done))
    return done
