"""`antdrive worlds show`."""

import json
from pathlib import Path

from tests.cli.calling import Call


def test_show_reports_whether_a_robot_can_cross(antdrive: Call, tmp_path: Path) -> None:
    code, out, _ = antdrive("worlds", "show", "gate", "--out", tmp_path / "gate.png")
    assert code == 0
    assert "passable           yes" in out
    assert (tmp_path / "gate.png").exists()
    assert not json.loads(antdrive("worlds", "show", "no-path", "--json")[1])["passable"]
