"""`antdrive robots`."""

import json
from pathlib import Path

from antdrive.robots import load_robot

URDF = Path(__file__).parents[2] / "robots" / "importing" / "urdf"


def test_the_file_of_a_robot_is_printed_as_a_start_for_another(antdrive, tmp_path):
    code, text, _ = antdrive("robots", "jackal")
    assert code == 0
    (tmp_path / "mine.yaml").write_text(text)
    assert load_robot(tmp_path / "mine.yaml") == load_robot("jackal")
    assert json.loads(antdrive("robots", "jackal", "--json")[1])["mass"] == 17.0
    code, _, error = antdrive("robots", "jackle")
    assert code == 2
    assert error.startswith("antdrive: jackle: unknown robot; choose from husky, jackal, pioneer3dx, ")
    assert error.count("\n") == 1
    assert antdrive("robots", "--json", "jackal") == antdrive("robots", "print", "jackal", "--json")
    assert antdrive("robots", "list") == antdrive("robots")


def test_a_robot_is_described_and_drawn(antdrive, tmp_path):
    code, out, err = antdrive("robots", "show", "warehouse", "-o", str(tmp_path / "warehouse.svg"))
    assert (code, err) == (0, "")
    assert "0.9 × 0.6 m; its middle 0.15 m ahead of the axle" in out
    assert "0.6708 m around the axle" in out
    assert (tmp_path / "warehouse.svg").read_text().startswith("<?xml")
    assert json.loads(antdrive("robots", "show", "pioneer3dx", "--json")[1])["footprint"]["corners"][0] == [
        0.188,
        -0.1905,
    ]
    assert antdrive("robots", "show", "wharehouse")[0] == 2
    assert antdrive("robots", "show", "jackal", "-o", str(tmp_path / "a.gif"))[0] == 2


def test_a_robot_is_imported_from_urdf_and_drawn(antdrive, tmp_path):
    source, target = URDF / "pioneer3dx.urdf", tmp_path / "mine.yaml"
    words = ("robots", "import", str(source), "-o", str(target))
    code, out, err = antdrive(
        *words, "--figure", str(tmp_path / "mine.png"), "--set", "mass=11", "--footprint", "rectangle"
    )
    assert (code, err) == (0, "")
    assert "# read: cylinder of link lwheel" in out
    assert load_robot(target).mass == 11
    assert load_robot(target).footprint.box is not None
    assert (tmp_path / "mine.png").stat().st_size > 10_000
    found = json.loads(antdrive(*words, "--json")[1])
    assert found["files"] == {"robot": str(target)}
    assert found["mass"] == 9.0


def test_a_xacro_file_gives_its_first_name_to_the_robot(antdrive, tmp_path):
    code, _, error = antdrive("robots", "import", str(URDF / "warehouse.urdf.xacro"))
    assert (code, error) == (0, "")
    assert (tmp_path / "warehouse.yaml").exists()
