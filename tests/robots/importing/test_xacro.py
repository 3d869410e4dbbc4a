"""xacro files as ROS users have them: includes, packages and their stand-ins."""

import re

import pytest

from antdrive.base import InputError
from antdrive.robots.importing.urdf_import import import_urdf
from tests.robots.importing.urdf_parts import box, joint, pair, robot

BODY = robot(box("base"), pair())
VARIABLES = ("AMENT_PREFIX_PATH", "COLCON_PREFIX_PATH", "CMAKE_PREFIX_PATH", "ROS_PACKAGE_PATH")


@pytest.fixture(autouse=True)
def without_ros(monkeypatch):
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)


def written(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def including(*names):
    return robot(*(f'<xacro:include filename="{name}"/>' for name in names))


def track_of(path, **settings):
    return import_urdf(path, **settings).spec.track


@pytest.mark.parametrize("name", ["robot.urdf.xacro", "robot.urdf"])
def test_includes_are_relative_to_the_including_file(tmp_path, monkeypatch, name):
    written(tmp_path / "a" / "parts" / "more" / "body.xacro", BODY)
    written(tmp_path / "a" / "parts" / "core.xacro", including("more/body.xacro"))
    path = written(tmp_path / "a" / name, including("parts/core.xacro"))
    for folder in (tmp_path, tmp_path / "a", tmp_path / "a" / "parts"):
        monkeypatch.chdir(folder)
        assert track_of(path) == pytest.approx(0.44)


def test_one_import_does_not_change_the_next(tmp_path):
    """Neither a failed one, nor one with another package of the same name."""
    for name, y in (("a", "0.22"), ("b", "0.24")):
        written(tmp_path / name / "parts" / "body.xacro", BODY.replace("0.22", y))
        written(tmp_path / name / "robot.xacro", including("$(find parts)/body.xacro"))
    broken = written(tmp_path / "c" / "robot.xacro", including("gone.xacro"))
    for _ in range(2):
        assert track_of(tmp_path / "a" / "robot.xacro") == pytest.approx(0.44)
        with pytest.raises(
            InputError, match=re.escape(f"No such file or directory: {tmp_path}/c/gone.xacro; if its package")
        ):
            track_of(broken)
        assert track_of(tmp_path / "b" / "robot.xacro") == pytest.approx(0.48)


@pytest.mark.parametrize(
    ("variable", "value", "folder"),
    [
        ("AMENT_PREFIX_PATH", "x:install", "install/share/parts"),
        ("CMAKE_PREFIX_PATH", "install", "install/share/parts"),
        ("COLCON_PREFIX_PATH", "install", "install/share/parts"),
        ("ROS_PACKAGE_PATH", "x:ws/src", "ws/src/stack/parts"),
        ("ROS_PACKAGE_PATH", "ws/src", "ws/src/named-otherwise"),
        ("", "", "mine"),
    ],
)
def test_packages_are_found_where_ros_has_them(tmp_path, monkeypatch, variable, value, folder):
    home = tmp_path / folder
    written(home / "urdf" / "body.xacro", BODY)
    written(home / "package.xml", "<package><name>parts</name></package>")
    path = written(tmp_path / "mine" / "urdf" / "robot.xacro", including("$(find parts)/urdf/body.xacro"))
    if variable:
        with pytest.raises(InputError, match="Package not found: parts; give its folder with --package parts=FOLDER"):
            track_of(path)
        monkeypatch.setenv(variable, ":".join(str(tmp_path / part) for part in value.split(":")))
    assert track_of(path) == pytest.approx(0.44)


def test_a_substitution_in_a_plain_file_is_resolved(tmp_path):
    text = BODY.replace('xyz="0.0 0.22 0.1"', 'xyz="$(optenv NO_SUCH_VARIABLE 0 0.22 0.1)"')
    assert text != BODY
    assert track_of(written(tmp_path / "robot.urdf", text)) == pytest.approx(0.44)


SENSOR = '<xacro:include filename="$(find sensors)/urdf/lidar.xacro"/><xacro:lidar name="front"/>'


def test_a_missing_package_of_sensors_is_noted_with_its_macros(tmp_path):
    mount = joint("mount", "front_mount", "0 0 0.5", "fixed")
    mount += '<link name="frame"/>' + joint("frame_joint", "frame", "0 0 0", "fixed", parent="front_camera")
    path = written(tmp_path / "robot.xacro", BODY.replace("</robot>", f"{SENSOR}{mount}</robot>"))
    found = import_urdf(path)
    assert found.spec.track == pytest.approx(0.44)
    assert (
        "packages not found: sensors; omitted with them: lidar, frame; --package NAME=FOLDER adds them" in found.notes
    )


def test_a_missing_package_that_the_base_needs_is_asked_for(tmp_path):
    remedy = "Package not found: sensors; give its folder with --package sensors=FOLDER"
    for text in (
        robot(box("base"), SENSOR),
        BODY.replace('parent link="base"', 'parent link="gone"').replace("</robot>", f"{SENSOR}</robot>"),
        BODY.replace("</robot>", SENSOR + '<a b="${size}"/></robot>'),
    ):
        with pytest.raises(InputError, match=remedy):
            import_urdf(written(tmp_path / "robot.xacro", text))


def test_a_macro_that_no_missing_package_can_have_is_refused(tmp_path):
    path = written(tmp_path / "robot.xacro", BODY.replace("</robot>", "<xacro:lidar/></robot>"))
    with pytest.raises(InputError, match=r"unknown macro name: xacro:lidar$"):
        import_urdf(path)
