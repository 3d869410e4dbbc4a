"""Where tests and benchmarks look for worlds and maps that nobody here made."""

from pathlib import Path

import pytest

from tools.shared_data import data_folder

CHECKOUT = Path(__file__).resolve().parents[2]


def test_the_environment_names_the_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("ANTDRIVE_DATA", str(tmp_path))
    assert data_folder() == tmp_path
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("ANTDRIVE_DATA", "~/maps")
    assert data_folder() == tmp_path / "maps"


@pytest.mark.parametrize("value", [None, ""])
def test_by_default_it_lies_beside_the_checkout(monkeypatch: pytest.MonkeyPatch, value: str | None) -> None:
    if value is None:
        monkeypatch.delenv("ANTDRIVE_DATA", raising=False)
    else:
        monkeypatch.setenv("ANTDRIVE_DATA", value)
    assert data_folder().resolve() == CHECKOUT.parent / "shared" / "data"
