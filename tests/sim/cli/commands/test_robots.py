"""`antdrive robots`."""

import json

from tests.sim.cli.calling import Call


def test_every_robot_is_listed(antdrive: Call) -> None:
    assert "jackal" in antdrive("robots")[1]
    code, out, err = antdrive("robots", "--json")
    assert (code, err) == (0, "")
    assert {"turtlebot", "jackal"} <= set(json.loads(out))
