"""`antdrive schema`."""

import json

import pytest

from tests.cli.calling import Call, Refused


@pytest.mark.parametrize("words", [[], ["world"], ["robot"]], ids=" ".join)
def test_the_schema_of_a_file_is_printed(antdrive: Call, words: list[str]) -> None:
    code, out, err = antdrive("schema", *words)
    assert (code, err) == (0, "")
    assert json.loads(out)["title"] == f"antdrive {words[0] if words else 'world'}"


def test_an_unknown_kind_is_refused_with_the_choices(refused: Refused) -> None:
    assert "choose from world, robot" in refused("schema", "moon")
