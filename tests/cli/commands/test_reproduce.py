"""`antdrive reproduce`."""

from pathlib import Path

import pytest

from tests.cli.calling import Call, Refused


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["reproduce", "lee2008", "--out", "/proc/nowhere"], "/proc/nowhere: cannot be written"),
        (["reproduce", "nobody"], "choose from han2007"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_wrong_input_is_one_line_and_exit_code_2(refused: Refused, words: list[str], says: str) -> None:
    assert says in refused(*words)


def test_the_default_folder_is_never_that_of_another_repetition(antdrive: Call) -> None:
    for seeds, kept in (("1", False), ("2", False), ("1", True)):
        code, shown, _ = antdrive("reproduce", "hasan", "--seeds", seeds)
        assert code == 0
        assert ("48 of 48 experiments were done before" in shown) == kept
    assert sorted(path.name for path in Path("out").iterdir()) == ["reproduce-hasan", "reproduce-hasan-2-seeds"]
