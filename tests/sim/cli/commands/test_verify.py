"""`antdrive verify`."""

from pathlib import Path

import pytest

from tests.sim.cli.calling import Refused


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["verify", "nothing.npz"], "no such file"),
        (["verify", "folder.mp4"], "folder.mp4: not a rollout (Is a directory)"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_wrong_input_is_one_line_and_exit_code_2(refused: Refused, words: list[str], says: str, tmp_path: Path) -> None:
    (tmp_path / "folder.mp4").mkdir()
    assert says in refused(*words)
