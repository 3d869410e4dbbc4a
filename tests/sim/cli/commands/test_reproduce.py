"""`antdrive reproduce`."""

import pytest

from tests.sim.cli.calling import Refused


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
