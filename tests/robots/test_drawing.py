"""What notebooks show of a robot."""

import dataclasses
import subprocess
import sys
from xml.etree import ElementTree

import pytest

from antdrive.robots import Footprint, RobotSpec
from antdrive.robots.drawing import robot_svg

SVG = "{http://www.w3.org/2000/svg}"


def drawn(robot: RobotSpec, kind: str) -> list[tuple[float, float, float, float]]:
    """x, y, width and height of the rectangles of a kind [m]."""
    root = ElementTree.fromstring(robot_svg(robot))
    rects = [part for part in root.iter(f"{SVG}rect") if part.get("class") == kind]
    return [tuple(float(part.attrib[key]) / 1000 for key in ("x", "y", "width", "height")) for part in rects]


@pytest.mark.parametrize("name", ["turtlebot", "jackal"])
def test_a_robot_is_shown_as_a_drawing_and_a_table(name: str, request: pytest.FixtureRequest) -> None:
    robot: RobotSpec = request.getfixturevalue(name)
    root = ElementTree.fromstring(robot._repr_html_())
    assert root[0].tag == f"{SVG}svg"
    rows = {row[0].text: row[1].text or "" for row in root.iter("tr")}
    assert f"{robot.max_speed:g} m/s" in rows["speed"]
    assert f"{robot.mass:g} kg" in rows["body"]
    assert "slip ±2 %" in rows["noise"]
    turtlebots = "360 beams all around, 5 Hz, 0.16 to 8 m; over the axle, 0.17 m high"
    jackals = "720 beams 270°, 50 Hz, 0.1 to 30 m; 0.055 m ahead of the axle, 0.24 m high"
    assert rows["lidar"] == (turtlebots if name == "turtlebot" else jackals)


def test_the_footprint_is_drawn_to_scale(turtlebot: RobotSpec, jackal: RobotSpec) -> None:
    assert drawn(turtlebot, "footprint") == [pytest.approx((-0.18, -0.18, 0.36, 0.36))]
    assert drawn(jackal, "footprint") == [pytest.approx((-0.254, -0.215, 0.508, 0.43))]


@pytest.mark.parametrize(
    ("footprint", "wheel_radius", "track"),
    [
        (Footprint.disc(0.18), 0.036, 0.23),
        (Footprint.disc(0.2), 0.1, 0.34),  # the wheels nearly reach the edge
        (Footprint.rectangle(0.508, 0.43), 0.098, 0.3756),
        (Footprint.rectangle(0.5, 0.4), 0.1, 0.39),  # the wheels' middles stand next to the edge
        (Footprint(0.1, 0.1, 0.1), 0.15, 0.3),
    ],
)
def test_wheels_are_drawn_where_they_stand(
    footprint: Footprint, wheel_radius: float, track: float, jackal: RobotSpec
) -> None:
    robot = dataclasses.replace(jackal, footprint=footprint, wheel_radius=wheel_radius, track=track)
    left, right = drawn(robot, "wheel")
    for (x, y, width, height), side in ((left, 1), (right, -1)):
        assert (x, width) == pytest.approx((-wheel_radius, 2 * wheel_radius), rel=1e-4)
        assert y + height / 2 == pytest.approx(side * track / 2, abs=1e-5)
        assert height > 0


def test_names_are_shown_and_not_run(jackal: RobotSpec) -> None:
    assert "<script>" not in dataclasses.replace(jackal, name="<script>")._repr_html_()


def test_the_table_of_a_robot_without_noise_lists_none(jackal: RobotSpec) -> None:
    quiet = dataclasses.replace(jackal, noise=jackal.noise.scaled(0.0))
    assert '<td style="text-align:left">none</td>' in quiet._repr_html_()


def test_showing_a_robot_imports_nothing_heavy() -> None:
    code = (
        "import sys; from antdrive.robots import load_robot; load_robot('jackal')._repr_html_(); "
        "heavy = ('matplotlib', 'numba', 'pybullet', 'antdrive.sim', 'antdrive.planners'); "
        "print([m for m in heavy if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
