"""`antdrive reproduce`."""

from pathlib import Path

import pytest

from antdrive.runs.papers import reproduction


@pytest.mark.slow
def test_the_default_folder_is_never_that_of_another_repetition(antdrive, monkeypatch):
    few = reproduction.PAPERS["hasan"]()[1:4]
    monkeypatch.setattr(reproduction, "PAPERS", {"hasan": lambda: few})
    for seeds, kept in (("1", False), ("2", False), ("1", True)):
        code, shown, _ = antdrive("reproduce", "hasan", "--seeds", seeds, "--jobs", "1")
        assert code == 0
        assert ("experiments reused" in shown) == kept
    assert sorted(path.name for path in Path("out").iterdir()) == ["reproduce-hasan", "reproduce-hasan-2-seeds"]
