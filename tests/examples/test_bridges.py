"""The example that leads from a URDF file to a bag: every command of its page works."""

import csv
import re
import shlex
import shutil
from pathlib import Path

import pytest

from antdrive.base.kernel_cache import COMPILING
from antdrive.robots import load_robot
from tests.cli.conftest import antdrive as antdrive  # a fixture

EXAMPLE = Path(__file__).parents[2] / "examples" / "bridges"
TEXT = re.sub(r" \\\n +", " ", (EXAMPLE / "README.md").read_text())
COMMANDS = [line for line in TEXT.splitlines() if line.startswith("antdrive ")]


@pytest.mark.slow
def test_every_command_works_and_the_bag_lies_in_the_map(antdrive, tmp_path):
    shutil.copytree(EXAMPLE, tmp_path, dirs_exist_ok=True)
    said = {}
    for command in COMMANDS:
        words = shlex.split(command, comments=True)[1:]
        words += ["--jobs", "1"] if words[0] == "sweep" else []
        code, out, err = antdrive(*words)
        faults = [line for line in err.splitlines() if COMPILING not in line]
        assert (code, faults) == (0, []), (command, err)
        said[words[0], words[1]] = out
    cart = load_robot(tmp_path / "cart.yaml")
    assert cart.footprint.bounds == pytest.approx((-0.27, -0.18, 0.15, 0.18))
    assert (cart.track, cart.wheel_radius, cart.mass) == pytest.approx((0.3, 0.06, 9.5))
    assert "goal in its map    [17.2, 0.2]" in said["worlds", "show"]
    assert "2 succeeded, certified" in said["sweep", "--world"]
    assert {"bench.mcap", "bench.foxglove.json", "cart.png"} <= {path.name for path in tmp_path.iterdir()}
    with (tmp_path / "bench_tables" / "drive.csv").open(newline="") as file:
        first, *_, last = csv.DictReader(file)
    assert (float(first["x_m"]), float(first["y_m"])) == pytest.approx((12.8, -2.2), abs=0.01)
    assert (float(last["x_m"]), float(last["y_m"])) == pytest.approx((17.2, 0.2), abs=0.25)
