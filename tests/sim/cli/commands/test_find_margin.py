"""`antdrive find-margin`."""

import json
from pathlib import Path

import pytest

from tests.sim.cli.calling import Call, Refused


def test_the_smallest_safe_margin_is_found(antdrive: Call, small: Path) -> None:
    code, out, err = antdrive("find-margin", small, "--seeds", "1", "--json", "-p", "astar", "--smoothing", "taut")
    facts = json.loads(out)
    assert (code, err) == (0, "")
    assert 0 <= facts["margin_m"] <= 0.03
    assert facts["trials"][0]["margin"] == pytest.approx(0.2)
    assert (
        "smallest safe margin" in antdrive("find-margin", small, "--seeds", "1", "-p", "astar", "--max-speed", "0.3")[1]
    )


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["find-margin"], "name a world, or a kind of random worlds"),
        (["find-margin", "empty", "--generate", "barn"], "name a world, or a kind of random worlds"),
        (["find-margin", "--generate", "desert"], "choose from forest, barn"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_wrong_input_is_one_line_and_exit_code_2(refused: Refused, words: list[str], says: str) -> None:
    assert says in refused(*words)
