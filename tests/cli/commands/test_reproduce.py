"""`antdrive reproduce`."""

from pathlib import Path

import pytest


@pytest.mark.slow
def test_the_default_folder_is_never_that_of_another_repetition(antdrive):
    for seeds, kept in (("1", False), ("2", False), ("1", True)):
        code, shown, _ = antdrive("reproduce", "hasan", "--seeds", seeds)
        assert code == 0
        assert ("experiments reused" in shown) == kept
    assert sorted(path.name for path in Path("out").iterdir()) == ["reproduce-hasan", "reproduce-hasan-2-seeds"]
