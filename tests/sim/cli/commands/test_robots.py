"""`antdrive robots`."""

import json
from pathlib import Path

from antdrive.robots import load_robot
from tests.sim.cli.calling import Call


def test_every_robot_is_listed(antdrive: Call) -> None:
    assert "jackal" in antdrive("robots")[1]
    code, out, err = antdrive("robots", "--json")
    assert (code, err) == (0, "")
    assert {"turtlebot", "jackal"} <= set(json.loads(out))


def test_the_file_of_a_robot_is_printed_as_a_start_for_another(antdrive: Call, tmp_path: Path) -> None:
    code, text, _ = antdrive("robots", "jackal")
    assert code == 0
    (tmp_path / "mine.yaml").write_text(text)
    assert load_robot(tmp_path / "mine.yaml") == load_robot("jackal")
    assert json.loads(antdrive("robots", "jackal", "--json")[1])["mass"] == 17.0
    code, _, error = antdrive("robots", "jackle")
    assert code == 2
    assert error == "antdrive: jackle: no robot of the catalogue; choose from jackal, turtlebot\n"
