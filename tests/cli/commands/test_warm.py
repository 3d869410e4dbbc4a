"""`antdrive warm`."""

import pytest

from tests.cli.calling import Call, Refused


def test_warm_compiles_on_request_and_once(antdrive: Call, compiled: list[str]) -> None:
    assert antdrive("warm") == (0, "every planner is compiled\n", "")
    assert antdrive("warm") == (0, "every planner is compiled already\n", "")
    assert compiled == ["all"]


def test_without_a_folder_for_the_cache_warm_is_refused(
    refused: Refused, compiled: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("antdrive.base.kernel_cache.cache_folder", lambda: None)
    assert "NUMBA_CACHE_DIR" in refused("warm")
    assert compiled == []
