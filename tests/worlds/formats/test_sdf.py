"""Gazebo worlds: cylinders, poses and invalid files."""

import math

import numpy as np
import pytest

from antdrive.base import InputError
from antdrive.worlds import Disc, import_sdf, point_clearance

GROUND = """
<model name='ground_plane'><static>1</static><link name='link'><collision name='c'>
  <geometry><plane><normal>0 0 1</normal><size>100 100</size></plane></geometry>
</collision></link></model>"""


def cylinder(name="can", pose="0 0 0 0 0 0", link="", collision="", radius=0.5, length=1.0, static="true"):
    return f"""
<model name='{name}'><static>{static}</static><pose frame=''>{pose}</pose>
  <link name='link'>{f"<pose>{link}</pose>" if link else ""}
    <collision name='c'>{f"<pose>{collision}</pose>" if collision else ""}
      <geometry><cylinder><radius>{radius}</radius><length>{length}</length></cylinder></geometry>
    </collision>
    <visual name='v'><geometry><mesh><uri>model://can.dae</uri></mesh></geometry></visual>
  </link>
</model>"""


def shape(tag, inside="", name="thing"):
    return f"""
<model name='{name}'><static>1</static><link name='l'><collision name='c'>
  <geometry><{tag}>{inside}</{tag}></geometry></collision></link></model>"""


def world(tmp_path, *parts):
    path = tmp_path / "made.world"
    path.write_text(
        f"<?xml version='1.0'?><sdf version='1.6'><world name='default'>{GROUND}{''.join(parts)}</world></sdf>"
    )
    return path


def discs(path, **options):
    return import_sdf(path, bounds=(-50, -50, 50, 50), **options).world.obstacles


def test_cylinders_become_discs(tmp_path):
    path = world(tmp_path, cylinder("a", "1 2 0.5 0 0 0"), cylinder("b", "-3 4 0.5 0 0 1", radius=0.25))
    assert discs(path) == (Disc(1.0, 2.0, 0.5, 1.0), Disc(-3.0, 4.0, 0.25, 1.0))


def test_composition_is_that_of_rotation_matrices(tmp_path):
    rng = np.random.default_rng(0)

    def about(axis, angle):
        c, s = math.cos(angle), math.sin(angle)
        i, j = [(1, 2), (2, 0), (0, 1)][axis]
        turn = np.eye(3)
        turn[i, i] = turn[j, j] = c
        turn[i, j], turn[j, i] = -s, s
        return turn

    for _ in range(20):
        place, (roll, pitch, yaw) = rng.uniform(-5, 5, 3), rng.uniform(-3, 3, 3)
        turn = about(2, yaw) @ about(1, pitch) @ about(0, roll)
        # A link that turns back what its model turned, expressed as roll, pitch and yaw.
        back = turn.T
        angles = (math.atan2(back[2, 1], back[2, 2]), -math.asin(back[2, 0]), math.atan2(back[1, 0], back[0, 0]))
        offset = rng.uniform(-2, 2, 3)
        pose = " ".join(map(str, [*place, roll, pitch, yaw]))
        link = " ".join(map(str, [*offset, *angles]))
        (disc,) = discs(world(tmp_path, cylinder(pose=pose, link=link, collision="1 2 0 0 0 0", length=100)))
        x, y, z = place + turn @ offset
        assert (disc.x, disc.y, disc.height) == pytest.approx((x + 1, y + 2, z + 50), abs=1e-9)


def test_a_cylinder_is_as_high_as_its_top_above_the_floor(tmp_path):
    parts = (cylinder("a", "0 0 0 0 0 0"), cylinder("b", "2 0 0 3.14159265 0 0"), cylinder("c", "4 0 -0.5 0 0 0"))
    assert [(d.x, d.height) for d in discs(world(tmp_path, *parts))] == [(0.0, 0.5), (2.0, 0.5)]


def test_floors_and_models_without_collisions_are_ignored(tmp_path):
    path = world(tmp_path, "<model name='sign'><static>1</static><link name='l'/></model>", cylinder())
    assert len(discs(path)) == 1


def test_several_links_collisions_and_nested_models_count(tmp_path):
    inner = cylinder("inner", "0 1 0.5 0 0 0", static="false")
    path = world(tmp_path, f"<model name='o'><static>1</static><pose>5 0 0 0 0 0</pose>{inner}</model>", cylinder())
    assert {(d.x, d.y) for d in discs(path)} == {(5.0, 1.0), (0.0, 0.0)}


def state(body):
    return f"<state world_name='default'>{body}</state>"


def test_poses_in_the_state_win(tmp_path):
    path = world(
        tmp_path,
        cylinder("a", "1 1 0.5 0 0 0", link="0.25 0 0 0 0 0"),
        cylinder("b", "2 2 0.5 0 0 0"),
        cylinder("c", "3 3 0.5 0 0 0"),
        state(
            "<model name='a'><pose>7 7 0.5 0 0 0</pose></model>"
            "<model name='b'><pose>8 8 0 0 0 0</pose><link name='link'><pose>8 9 0.5 0 0 0</pose></link></model>"
        ),
    )
    assert [(d.x, d.y) for d in discs(path)] == [(7.25, 7.0), (8.0, 9.0), (3.0, 3.0)]


def test_the_scale_in_the_state_stretches(tmp_path):
    scaled = "<model name='can'><pose>1 1 0 0 0 0</pose><scale>0.5 0.5 4</scale></model>"
    path = world(tmp_path, cylinder(), state(scaled))
    assert discs(path) == (Disc(1.0, 1.0, 0.25, 2.0),)


def test_degrees_are_degrees(tmp_path):
    model = cylinder(link="2 0 0.5 0 0 0").replace("<pose frame=''>0 0 0 0 0 0", "<pose degrees='true'>0 0 0 0 0 90")
    (disc,) = discs(world(tmp_path, model))
    assert (disc.x, disc.y) == pytest.approx((0.0, 2.0))


UNSUPPORTED = {
    "terrain": shape("heightmap", name="hill"), "image": shape("image", name="statue"),
    "standing plane": shape("plane", "<normal>1 0 0</normal>", "wall"),
    "other frame": cylinder("tied").replace("<pose frame=''>", "<pose relative_to='other'>"),
    "short pose": cylinder("odd", "1 2 3"), "pose of words": cylinder("odd", "a b c d e f"),
    "infinite pose": cylinder("odd", "inf 0 0 0 0 0"), "negative radius": cylinder("odd", radius=-1.0),
    "flat box": shape("box", "<size>1 0 1</size>"), "no radius": shape("sphere"),
    "quaternion": cylinder("odd").replace("<pose frame=''>", "<pose rotation_format='quat_xyzw'>"),
    "part of a mesh": shape("mesh", "<uri>made.world</uri><submesh><name>wheel</name></submesh>"),
    "two points": shape("polyline", "<point>0 0</point><point>1 0</point><height>1</height>"),
    "far box": shape("box", "<size>1e6 1e6 9e5</size>").replace("<collision name='c'>", "<collision><pose>9e5 0 0 0 0 0</pose>"),
    "included": "<include><uri>model://house</uri></include>",
    "no mesh": shape("mesh"),
    "mesh": shape("mesh", "<uri>model://x.dae</uri>", "statue"), "population": "<population name='crowd'/>",
    "fast actor": "<actor name='a'><script><trajectory id='0'><waypoint><time>0</time><pose>0 0 0 0 0 0</pose></waypoint>"
    "<waypoint><time>1</time><pose>90 0 0 0 0 0</pose></waypoint></trajectory></script></actor>",
}  # fmt: skip


@pytest.mark.parametrize("case", UNSUPPORTED)
def test_what_is_unsupported_can_be_skipped(case, tmp_path):
    path = world(tmp_path, cylinder("good", "5 5 0.5 0 0 0"), UNSUPPORTED[case])
    with pytest.raises(InputError, match="--skip-unsupported"):
        discs(path)
    assert discs(path, skip_unsupported=True) == (Disc(5.0, 5.0, 0.5),)


def test_the_supported_parts_of_a_model_stay_and_each_skipped_part_is_named(tmp_path):
    post = "<cylinder><radius>0.05</radius><length>0.7</length></cylinder>"
    leg = f"<collision name='leg'><pose>0.4 0 0.35 0 0 0</pose><geometry>{post}</geometry></collision>"
    top = "<collision name='top'><geometry><image><uri>a.png</uri></image></geometry></collision>"
    lamp = f"<model name='lamp'><link name='l'>{top.replace('image', 'heightmap')}</link></model>"
    table = f"<model name='table'><static>1</static><pose>3 2 0 0 0 0</pose><link name='body'>{top}{leg}</link>{lamp}</model>"
    skipped = []
    task = import_sdf(world(tmp_path, table), skip_unsupported=True, on_skipped=skipped.extend)
    assert task.world.obstacles == (Disc(3.4, 2.0, 0.05, 0.7),)
    assert skipped == ["table::body::top (shape image)", "table::lamp::l::top (uneven ground)"]


def test_the_usual_includes_are_ignored(tmp_path):
    names = (
        "model://sun",
        "model://ground_plane",
        "https://fuel.gazebosim.org/1.0/OpenRobotics/models/Ground Plane/3",
        "Sun",
    )
    includes = [f"<include><uri>{name}</uri></include>" for name in names]
    assert len(discs(world(tmp_path, *includes, cylinder()))) == 1


BAD_XML = {
    "no xml": "hello", "empty": "", "cut off": "<sdf>\n<world>\n", "no sdf": "<robot name='r'/>",
    "no world": "<sdf version='1.6'><light name='m'/></sdf>", "no obstacle": "<sdf><world name='w'/></sdf>",
    "entities": "<!DOCTYPE sdf [<!ENTITY a 'b'>]><sdf><world>&a;</world></sdf>",
    "external entity": "<!DOCTYPE s SYSTEM 'file:///etc/passwd'><sdf/>", "deep": "<a>" * 5000 + "</a>" * 5000,
    "xacro": "<sdf xmlns:xacro='http://ros.org/wiki/xacro'><xacro:arg name='a'/><world name='w'/></sdf>",
    "unknown encoding": "<?xml version='1.0' encoding='x-nothing'?><sdf/>",
}  # fmt: skip


def test_without_bounds_the_robot_gets_room_around_the_cylinders(tmp_path):
    task = import_sdf(world(tmp_path, cylinder("a", "0 0 0.5 0 0 0"), cylinder("b", "4 2 0.5 0 0 0")))
    assert task.world.bounds == (-1.5, -1.5, 5.5, 3.5)
    assert math.dist(task.start[:2], task.goal) > 4.0
    assert task.world.name == "made"
    assert (point_clearance(task.world, [task.start[:2], task.goal]) >= 0.5).all()


def test_the_usual_ends_are_inside_of_walls_that_enclose_more_than_the_ground_around_them(tmp_path):
    sides = [(x, y, 0.5, 0, 0, yaw) for x, y, yaw in ((0, 5, 0), (0, -5, 0), (5, 0, 1.5708), (-5, 0, 1.5708))]
    pose = [" ".join(map(str, side)) for side in sides]
    walls = [
        shape("box", "<size>10.2 0.2 1</size>", f"w{i}").replace("<link", f"<pose>{p}</pose><link")
        for i, p in enumerate(pose)
    ]
    task = import_sdf(world(tmp_path, *walls))
    for x, y in (task.start[:2], task.goal):
        assert max(abs(x), abs(y)) == pytest.approx(4.4, abs=0.2)


def test_given_ends_are_inside_the_bounds(tmp_path):
    task = import_sdf(world(tmp_path, cylinder()), start=(9.0, 0.0, 0.0), goal=(0.0, -7.0))
    assert task.world.bounds == (-1.5, -8.0, 10.0, 1.5)
