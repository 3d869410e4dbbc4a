"""Messages for invalid robots in files, URDF and Python; the snapshot is `messages.yml`."""

import dataclasses
import math

from antdrive.robots import Avoidance, Footprint, Noise, Odometry, list_robots, load_robot
from antdrive.robots.importing.urdf_import import import_urdf
from tests.messages import check_messages, numbered
from tests.robots import test_lidar, test_polygons, test_robot_file
from tests.robots.importing import test_urdf_import as test_urdf

NOISE = ({"slip": 0.6}, {"pose_xy": -0.1}, {"delay": math.nan}, {"pose_rate": 0.5})
AVOIDANCE = ({"horizon": 0.0}, {"step": 61.0}, {"min_clearance": math.nan}, {"reversal_margin": -0.1})
ROBOTS = ({"max_speed": 0.0025}, {"max_speed": math.nan}, {"wheel_friction": 0.01}, {"wheel_torque": 1e7})
TRUCK = {
    "{radius: 0.2}": "{length: 6.0, width: 2.5}", "height: 0.3": "height: 3.0", "mass: 5.0": "mass: 2.0e+4",
    "track: 0.25": "track: 2.0", "wheel_radius: 0.04": "wheel_radius: 0.5", "wheel_torque: 2.0": "wheel_torque: 1.0e+4",
}  # fmt: skip


def test_invalid_robots_are_refused_in_one_line(tmp_path, jackal, data_regression):
    def robot(old, new):
        assert old in test_robot_file.GOOD
        (tmp_path / "mine.yaml").write_text(test_robot_file.GOOD.replace(old, new))
        return load_robot(tmp_path / "mine.yaml")

    def noisy(wrong):
        (tmp_path / "noisy.yaml").write_text(list_robots()["turtlebot"].read_text().replace("slip: 0.02", wrong))
        return load_robot(tmp_path / "noisy.yaml")

    def truck():
        text = test_robot_file.GOOD
        for old, new in TRUCK.items():
            text = text.replace(old, new)
        (tmp_path / "truck.yaml").write_text(text)
        return load_robot(tmp_path / "truck.yaml")

    def urdf(name):
        (tmp_path / name).write_text("<robot/>")
        return tmp_path / name

    calls = {
        "robot files": {
            " ".join((new or f"no {old}").split()): lambda w=(old, new): robot(*w) for old, new in test_robot_file.WRONG
        },
        "lidars": {str(wrong): lambda w=wrong: test_lidar.changed(tmp_path, **w) for wrong in test_lidar.WRONG},
        "urdf": numbered(
            lambda c=changes: import_urdf(test_urdf.changed(tmp_path, "burger.urdf", *c)) for changes in test_urdf.WRONG
        ),
        "noise in files": {wrong: lambda w=wrong: noisy(w) for wrong in ("slip: 2", "slop: 0.1", "slip: often")},
        "noise": {str(words): lambda w=words: Noise(**w) for words in NOISE},
        "odometry": {"gyro_bias": lambda: Odometry(gyro_bias=5.0)},
        "avoidance": {str(words): lambda w=words: Avoidance(**w) for words in AVOIDANCE},
        "robots in Python": {str(words): lambda w=words: dataclasses.replace(jackal, **w) for words in ROBOTS},
        "files": {
            "a truck of 20 t whose motors are too weak": truck,
            **{name: lambda n=name: load_robot(urdf(n)) for name in ("mine.urdf", "mine.urdf.xacro")},
            "jackel": lambda: load_robot("jackel"),
        },
        "polygons": numbered(lambda p=points: Footprint.polygon(p) for points in test_polygons.NO_POLYGONS),
    }
    check_messages(calls, data_regression, tmp_path)
