"""What is said of wrong robots, in files, in URDF and in Python: all of it is in `messages.yml`."""

from __future__ import annotations

from pathlib import Path

from pytest_regressions.data_regression import DataRegressionFixture

from antdrive.robots import Footprint, load_robot
from antdrive.robots.importing.urdf import import_urdf
from tests.messages import check_messages, numbered
from tests.robots import test_files, test_lidar, test_polygons
from tests.robots.importing import test_urdf


def test_wrong_robots_are_refused_in_one_line(tmp_path: Path, data_regression: DataRegressionFixture) -> None:
    def robot(old: str, new: str) -> object:
        assert old in test_files.GOOD
        (tmp_path / "mine.yaml").write_text(test_files.GOOD.replace(old, new))
        return load_robot(tmp_path / "mine.yaml")

    calls = {
        "robot files": {
            " ".join((new or f"no {old}").split()): lambda w=(old, new): robot(*w) for old, new in test_files.WRONG
        },
        "lidars": {str(wrong): lambda w=wrong: test_lidar.changed(tmp_path, **w) for wrong in test_lidar.WRONG},
        "urdf": numbered(
            lambda c=changes: import_urdf(test_urdf.changed(tmp_path, "burger.urdf", *c)) for changes in test_urdf.WRONG
        ),
        "polygons": numbered(lambda p=points: Footprint.polygon(p) for points in test_polygons.NO_POLYGONS),
    }
    check_messages(calls, data_regression, tmp_path)
