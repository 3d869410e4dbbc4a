"""Import of lidars from URDF files."""

import math
from pathlib import Path

import pytest

from antdrive.robots import Lidar
from antdrive.robots.importing.urdf_import import import_urdf

BURGER = (Path(__file__).parent / "urdf" / "burger.urdf").read_text()
SENSOR = (
    '<gazebo reference="scan"><sensor name="{name}" type="{kind}">{pose}<update_rate>5</update_rate><{tag}><scan><horizontal>'
    "<samples>{samples}</samples><min_angle>{low}</min_angle><max_angle>{high}</max_angle></horizontal>{vertical}</scan><range>"
    "<min>0.12</min><max>{far}</max><resolution>0.015</resolution></range>"
    "<noise><type>gaussian</type><stddev>0.01</stddev></noise></{tag}></sensor></gazebo>"
)
USUAL = {
    "name": "lds", "kind": "ray", "tag": "ray", "pose": "", "samples": "360", "low": "0", "high": "6.28", "vertical": "",
    "far": "3.5",
}  # fmt: skip


def imported(tmp_path, *sensors, joint='xyz="-0.032 0 0.167"'):
    path = tmp_path / "burger.urdf"
    text = BURGER.replace('<origin xyz="-0.032 0 0.167"/>', f"<origin {joint}/>")
    assert joint in text
    path.write_text(text.replace("</robot>", "".join(sensors) + "</robot>"))
    return import_urdf(path)


def sensor(**changes):
    return SENSOR.format(**USUAL | changes)


@pytest.mark.parametrize(("kind", "tag"), [("ray", "ray"), ("gpu_ray", "ray"), ("gpu_lidar", "lidar")])
def test_a_lidar_is_read_where_it_is(tmp_path, kind, tag):
    found = imported(tmp_path, sensor(kind=kind, tag=tag))
    assert found.spec.lidar == Lidar(
        beams=360, field_of_view=6.283185, min_range=0.12, max_range=3.5, rate=5.0, resolution=0.015, sigma=0.01,
        x=-0.032, height=0.177,
    )  # fmt: skip
    assert (
        "# read: sensor lds of link scan\nlidar: {beams: 360, field_of_view: 6.283185, min_range: 0.12," in found.text
    )
    assert imported(tmp_path).spec.lidar is None


@pytest.mark.parametrize(
    ("joint", "pose", "heading"),
    [
        ("0 0 0", "", math.pi / 4),
        ("0 0 1.5707963", "", 3 * math.pi / 4),
        ("3.1415927 0 0", "", -math.pi / 4),  # upside down
        ("0 0 1.5707963", "<pose>0.05 0.02 0.03 0 0 -1.5707963</pose>", math.pi / 4),
    ],
)
def test_a_lidars_yaw_is_the_middle_of_its_field_of_view(tmp_path, joint, pose, heading):
    found = imported(
        tmp_path, sensor(high="1.5707963", pose=pose), joint=f'xyz="0 0.01 0.167" rpy="{joint}"'
    ).spec.lidar
    assert found.yaw == pytest.approx(heading, abs=1e-5)
    assert (found.field_of_view, found.beams) == (pytest.approx(math.pi / 2, abs=1e-6), 360)
    spot = (-0.02, 0.06, 0.207) if pose else (0.0, 0.01, 0.177)  # the pose is in the turned link
    assert (found.x, found.y, found.height) == pytest.approx(spot, abs=1e-5)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"vertical": "<vertical><samples>16</samples></vertical>"}, "scan: has several layers"),
        ({"pose": "<pose>0 0 0 0 0.5 0</pose>"}, "pose: its beams are not level"),
        ({"pose": "<pose>0 0 up</pose>"}, "pose: must be 6 numbers, got '0 0 up'"),
        ({"far": "wide"}, "max: must be a number, got 'wide'"),
        ({"far": "0.1"}, "min_range: must be below max_range, 0.1, got 0.12"),
        ({"samples": "1"}, "beams: must be between 3 and 10000, got 1"),
        (
            {"pose": "<pose>3 0 0 0 0 0</pose>"},
            "lidar.x: the lidar at (2.968, 0) is 2.93 m outside the footprint; it must be on the robot",
        ),
        ({"tag": "beam"}, "scan: has no horizontal samples"),
    ],
)
def test_an_unusable_lidar_is_omitted_with_the_reason(tmp_path, changes, says):
    found = imported(tmp_path, sensor(**changes))
    assert found.spec.lidar is None
    assert f"# note: sensor lds of link scan is not used: {says}" in found.text.splitlines()


def test_a_second_lidar_is_noted_with_where_it_looks(tmp_path):
    few = sensor(samples="1")
    found = imported(
        tmp_path, few, sensor(), sensor(name="back", high="1.5708", pose="<pose>0 0 0 0 0 3.1416</pose>"), few
    )
    assert found.spec.lidar is not None
    assert found.notes[-2:] == (
        "sensor back of link scan is not used, because a robot file has one lidar; it looks 135° to the right with 90° of view",
        "sensor lds of link scan is not used: beams: must be between 3 and 10000, got 1, nor are 1 more",
    )


def test_what_is_no_lidar_is_none(tmp_path):
    found = imported(tmp_path, sensor(kind="camera"), sensor().replace('reference="scan"', 'reference="nowhere"'))
    assert found.spec.lidar is None
    assert "lidar" not in found.text


def test_a_rate_that_is_missing_is_assumed(tmp_path):
    found = imported(tmp_path, sensor().replace("<update_rate>5</update_rate>", ""))
    assert found.spec.lidar.rate == 10.0
    assert "# read: sensor lds of link scan; rate of 10 Hz assumed" in found.text
