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


@pytest.mark.parametrize("name", ["empty", "unclosed list", "misspelt key inside", "start in a mover"])
def test_a_malformed_world_is_one_line_and_exit_code_2(refused: Refused, name: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(str(MALFORMED[name]))
    assert str(path) in refused("plan", path)
