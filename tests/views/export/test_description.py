"""The robot's description: bodies stand where the footprint does."""

import dataclasses
from xml.etree import ElementTree

import pytest

from antdrive.robots import Footprint, RobotSpec
from antdrive.views.export.description import description


@pytest.mark.parametrize(
    ("footprint", "shape", "size", "middle"),
    [
        (Footprint.disc(0.2), "cylinder", ("radius", "0.2"), (0.0, 0.0)),
        (Footprint.disc(0.2, (0.05, -0.01)), "cylinder", ("radius", "0.2"), (0.05, -0.01)),
        (Footprint.polygon([(0.3, -0.2), (0.3, 0.2), (-0.1, 0.2), (-0.1, -0.2)]), "box", None, (0.1, 0.0)),
    ],
    ids=["disc", "disc off the axle", "rectangle off the axle"],
)
def test_the_body_stands_where_the_footprint_does(
    turtlebot: RobotSpec,
    footprint: Footprint,
    shape: str,
    size: tuple[str, str] | None,
    middle: tuple[float, float],
) -> None:
    robot = dataclasses.replace(turtlebot, footprint=footprint)
    visual = ElementTree.fromstring(description(robot)).find("link[@name='base_link']/visual")
    assert visual is not None
    body, origin = visual.find(f"geometry/{shape}"), visual.find("origin")
    assert body is not None
    assert origin is not None
    assert [float(v) for v in origin.attrib["xyz"].split()[:2]] == pytest.approx(middle)
    if size is None:
        assert [float(v) for v in body.attrib["size"].split()[:2]] == pytest.approx([0.4, 0.4])
    else:
        assert body.attrib[size[0]] == size[1]


def test_any_name_of_a_robot_can_be_read_again(turtlebot: RobotSpec) -> None:
    name = 'a <robot> & "another"\n\tone'
    assert ElementTree.fromstring(description(dataclasses.replace(turtlebot, name=name))).get("name") == name
