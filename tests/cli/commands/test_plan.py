"""`antdrive plan`."""

import json
from pathlib import Path

import pytest

from tests.cli.calling import Call, Refused
from tests.worlds.malformed import MALFORMED


def test_a_plan_is_drawn_and_printed_without_a_drive(antdrive: Call, tmp_path: Path) -> None:
    code, out, _ = antdrive("plan", "han2007-aco", "--planner", "aco-han", "--json", "--out", tmp_path / "p")
    facts = json.loads(out)
    assert code == 0
    assert facts["status"] == "solved"
    assert len(facts["cells"]) > 10
    assert Path(facts["files"]["plan"]).read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", MALFORMED)
def test_a_malformed_world_is_one_line_and_exit_code_2(refused: Refused, name: str, tmp_path: Path) -> None:
    content, says = MALFORMED[name]
    path = tmp_path / "bad.yaml"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    line = refused("plan", path)
    assert str(path) in line
    assert says in line


def test_there_are_at_least_30_malformed_worlds() -> None:
    assert len(MALFORMED) >= 30
