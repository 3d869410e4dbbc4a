"""`antdrive report`."""

import pytest

from tests.cli.calling import Refused


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["report", "nowhere", "-o", "r.html"], "nowhere: no such folder"),
        (["report", ".", "-o", "r.pdf"], "choose .html or .md"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_wrong_input_is_one_line_and_exit_code_2(refused: Refused, words: list[str], says: str) -> None:
    assert says in refused(*words)
