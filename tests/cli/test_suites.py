"""What `antdrive check` and `antdrive accept` share."""

from types import SimpleNamespace
from typing import Any

import pytest

from antdrive.cli import suites


@pytest.mark.parametrize(("cores", "asked", "started"), [(3, None, 3), (3, 2, 2), (64, None, 10)])
def test_a_process_for_each_core_that_may_be_used(
    cores: int, asked: int | None, started: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """joblib counts those of a container; the operating system says how many its host has."""
    found: list[int] = []
    case = SimpleNamespace(given={"margin": 0.03})

    def check_cases(cases: list[Any], *, jobs: int, **others: Any) -> list[Any]:
        found.append(jobs)
        return []

    monkeypatch.setattr("joblib.cpu_count", lambda: cores)
    monkeypatch.setattr("antdrive.runs.suites.select", lambda words, only: [case] * 10)
    monkeypatch.setattr("antdrive.cli.testing.check_cases", check_cases)
    monkeypatch.setattr(suites, "compile_once", lambda: None)
    assert suites.drive_suites(["a"], None, asked, update="nothing", results=None) == []  # type: ignore[arg-type]
    assert found == [started]
