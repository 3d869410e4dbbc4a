"""Poses, maps and footprints read back from bags and tables."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from antdrive.base.errors import InputError
from antdrive.foreign.log import read_log
from antdrive.foreign.recorded import read_footprint, read_map
from tests.foreign import writing
from tests.foreign.writing import START, STORAGES, odometry, stamped, transforms, write, write_bag

T = np.arange(0, 10, 0.02)


def circle(t, radius=3.0):
    return np.column_stack([radius * np.cos(t / 5), radius * np.sin(t / 5), t / 5 + np.pi / 2])


def off(pose, other):
    """The largest difference of poses, of the yaw modulo a turn."""
    turned = (pose[:, 2] - other[:, 2] + np.pi) % (2 * np.pi) - np.pi
    return max(np.abs(pose[:, :2] - other[:, :2]).max(), np.abs(turned).max())


@pytest.mark.parametrize("storage", STORAGES)
@pytest.mark.parametrize("compressed", [False, True, "message"])
def test_every_storage_gives_the_same_poses(tmp_path, storage, compressed):
    path = write_bag(tmp_path / "bag", T, circle(T), storage=storage, late=True, scan_rate=1, compressed=compressed)
    files = [path, *(file for file in path.glob("*") if file.suffix in (".mcap", ".db3"))]
    for file in files:
        log = read_log(file)
        assert np.allclose(log.t, T, atol=1e-6)
        assert log.start == START
        assert off(log.pose, circle(T)) < 1e-9
        assert log.findings == ()
        assert not log.unknown.any()
        assert log.source["poses"] == "tf: map > odom > base_footprint"
        if compressed == "message":  # its file alone does not say so
            break


def test_a_bag_of_mcap_ros2_support(tmp_path):
    """Its definitions are those that the test states, and its file stands alone."""
    from mcap_ros2.writer import Writer

    text = (
        "geometry_msgs/TransformStamped[] transforms\n" + "=" * 80 + "\nMSG: geometry_msgs/TransformStamped\n"
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n" + "=" * 80 + "\n"
        "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n" + "=" * 80 + "\n"
        "MSG: geometry_msgs/Transform\ngeometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"
        + "=" * 80
        + "\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
        + "=" * 80
        + "\n"
        "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n" + "=" * 80 + "\n"
        "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    )
    with (tmp_path / "drive.mcap").open("wb") as file:
        writer = Writer(file)
        schema = writer.register_msgdef("tf2_msgs/msg/TFMessage", text)
        for sent in transforms(START + T, "map", "base_link", circle(T)):
            writer.write_message("/tf", schema, sent.fields, log_time=sent.received, publish_time=sent.received)
        writer.finish()
    log = read_log(tmp_path / "drive.mcap")
    assert off(log.pose, circle(T)) < 1e-9
    assert log.source["robot_frame"] == "base_link"


def spatial(t, parent, child, rng, topic="/tf"):
    """A frame that turns in space: its places, rotations and messages."""
    places = rng.normal(size=(len(t), 3))
    turns = Rotation.from_rotvec(np.cumsum(rng.normal(size=(len(t), 3)) * 0.3, axis=0))
    sent = list(transforms(START + t, parent, child, np.zeros((len(t), 3)), topic=topic))
    for one, place, turn in zip(sent, places, turns.as_quat(), strict=True):
        step = one.fields["transforms"][0]["transform"]
        step["translation"] = writing.xyz(*place)
        step["rotation"] = dict(zip("xyzw", (turn * rng.choice([-1, 1])).tolist(), strict=True))
    return places, turns, sent


@pytest.mark.parametrize("seed", range(5))
def test_transforms_are_interpolated_as_an_independent_library_does(tmp_path, seed):
    """map > odom, then from odom up to base_footprint, at other times, then a static step."""
    rng = np.random.default_rng(seed)
    slow, fast = np.sort(rng.uniform(0, 10, 30)).round(6), np.sort(rng.uniform(1, 9, 90)).round(6)
    place, turn, first = spatial(slow, "map", "odom", rng)
    rise, spin, second = spatial(fast, "base_footprint", "odom", rng)
    step, bend, third = spatial(fast[-1:], "base_footprint", "base_link", rng, topic="/tf_static")
    log = read_log(write(tmp_path / "bag", [*first, *second, *third]), robot_frame="base_link")
    t = fast[(fast >= slow[0]) & (fast <= slow[-1])]
    at = np.column_stack([np.interp(t, slow, column) for column in place.T])
    k = np.searchsorted(fast, t)
    upward = spin[k].inv()
    turned = Slerp(slow, turn)(t)
    whole = turned * upward * bend
    there = at + turned.apply(upward.apply(step - rise[k]))
    forward = whole.apply([1.0, 0, 0])
    assert np.allclose(log.t, t - t[0], atol=1e-6)
    assert np.allclose(log.pose[:, :2], there[:, :2], atol=1e-5)
    assert np.allclose(np.cos(log.pose[:, 2] - np.arctan2(forward[:, 1], forward[:, 0])), 1, atol=1e-7)
    assert any(line.startswith("tilt") for line in log.findings)
    assert any(line.startswith("height") for line in log.findings)


def test_a_static_transform_is_used_if_it_is_one(tmp_path):
    sent = list(transforms(START + T, "map", "base_link", circle(T)))
    for places, words in (([[0.2, 0, 0], [0.3, 0, 0]], "base_link > lidar changes"), ([[np.nan, 0, 0]], "or is none")):
        more = transforms(START + np.arange(len(places)), "base_link", "lidar", places, topic="/tf_static")
        path = write(tmp_path / f"bag{len(places)}", [*sent, *more])
        assert off(read_log(path).pose, circle(T)) < 1e-9
        with pytest.raises(InputError, match=words):
            read_log(path, robot_frame="lidar")


def test_rows_that_need_extrapolation_are_left_out(tmp_path):
    slow = np.arange(1, 9, 0.1)
    sent = [
        *transforms(START + slow, "map", "odom", np.zeros((len(slow), 3))),
        *transforms(START + T, "odom", "base_link", circle(T)),
    ]
    log = read_log(write(tmp_path / "bag", sent))
    assert log.start == START + 1
    assert log.start + log.t[-1] <= START + slow[-1] + 1e-6
    assert any("rows left out" in line for line in log.findings)


def test_rows_are_those_of_the_transforms_that_move_the_robot_even_if_others_come_more_often(tmp_path):
    slow = T[::25]
    sent = [
        *transforms(START + T, "map", "odom", 0.01 * np.sin(T)[:, None] * (1, 0, 0)),
        *transforms(START + slow, "odom", "base_link", circle(slow)),
    ]
    log = read_log(write(tmp_path / "bag", sent))
    np.testing.assert_allclose(log.t, slow[: len(log.t)], atol=1e-6)


def test_a_topic_of_poses_is_moved_into_the_map(tmp_path):
    odom = np.tile([2.0, 1.0, np.pi / 2], (len(T), 1))
    sent = [*transforms(START + T, "map", "odom", odom), *odometry(START + T, circle(T), variance=0.04)]
    path = write(tmp_path / "bag", sent)
    log = read_log(path, pose="/odom")
    assert off(log.pose, writing.joined(odom, circle(T))) < 1e-9
    assert any("standard deviations of x and y up to 0.200 m" in line for line in log.findings)
    assert off(read_log(path).pose, log.pose) == 0  # the only topic of poses


def test_the_only_topic_of_poses_is_used(tmp_path):
    log = read_log(write(tmp_path / "bag", stamped(START + T, circle(T), topic="/a")))
    assert log.source["poses"] == "map > /a"
    assert off(log.pose, circle(T)) < 1e-9


@pytest.mark.parametrize(
    ("sent", "options", "words"),
    [
        ([*odometry(START + T, circle(T)), *stamped(START + T, circle(T))], {}, "--pose /odom, /pose"),
        (stamped(START + T, circle(T)), {"pose": "/amcl"}, "no poses on /amcl; --pose takes /pose"),
        (
            transforms(START + T, "map", "base_link", circle(T)),
            {"robot_frame": "x"},
            "no frame x; --robot-frame takes base_link, map",
        ),
        (transforms(START + T, "a", "b", circle(T)), {}, "and it has no topic of poses"),
        (
            [
                *transforms(START + T, "map", "r1/base_link", circle(T)),
                *transforms(START + T, "map", "r2/base_link", circle(T)),
            ],
            {},
            "several frames of robots; --robot-frame takes r1/base_link, r2/base_link",
        ),
        (
            [
                one
                for name in ("r1", "r2")
                for one in transforms(START + T, "a", "base_link", circle(T), topic=f"/{name}/tf")
            ],
            {},
            "several trees of frames; name one: --pose /r1/tf, /r2/tf",
        ),
        (transforms(START + T[:1], "map", "base_link", circle(T[:1])), {}, "fewer than two valid poses"),
        ([], {}, "no moving transforms"),
    ],
)
def test_what_is_not_clear_is_one_line_with_the_choices(tmp_path, sent, options, words):
    path = write(tmp_path / "bag", sent)
    with pytest.raises(InputError) as caught:
        read_log(path, **options)
    assert words in str(caught.value)
    assert str(path) in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_two_robots_share_a_clock(tmp_path):
    sent = [
        *transforms(START + T, "map", "r1/base_link", circle(T)),
        *transforms(START + 3 + T, "map", "r2/base_link", circle(T, 5)),
    ]
    path = write(tmp_path / "bag", sent)
    one, two = (read_log(path, robot_frame=f"{name}/base_link") for name in ("r1", "r2"))
    assert two.start - one.start == pytest.approx(3.0)
    assert off(two.pose, circle(T, 5)) < 1e-9


@pytest.mark.parametrize("storage", STORAGES)
@pytest.mark.parametrize("origin", [(-1.0, 2.0, 0.0), (-1.0, 2.0, 0.5)])
def test_a_recorded_map(tmp_path, storage, origin):
    cells = np.zeros((4, 6))
    cells[0], cells[1, 2], cells[3, 5] = 100, -1, 50
    served, frame = read_map(write_bag(tmp_path / "bag", T, circle(T), storage=storage, cells=cells, origin=origin))
    assert frame == "map"
    assert served.unknown == 2
    assert served.cells.free.tolist() == (cells == 0).tolist()
    assert served.cells.resolution == 0.05
    if origin[2]:
        assert served.frame == pytest.approx(origin)
        assert served.cells.origin == (0, 0)
    else:
        assert served.frame == (0, 0, 0)
        assert served.cells.origin == origin[:2]
    free, _ = read_map(tmp_path / ("bag.bag" if storage == "ros1" else "bag"), unknown_is_free=True)
    assert free.cells.free.sum() == (cells == 0).sum() + 2


def test_a_map_is_that_on_its_topic_or_the_only_grid(tmp_path):
    grids = [writing.grid(START, np.full((2, 2), full), topic=f"/{name}") for name, full in (("a", 100), ("b", 0))]
    assert read_map(write(tmp_path / "one", grids[1:]))[0].cells.free.all()
    with pytest.raises(
        InputError, match="2 topics of nav_msgs/msg/OccupancyGrid; name a map with --map; it has /a, /b"
    ):
        read_map(write(tmp_path / "two", grids))
    grids.append(writing.grid(START, np.zeros((2, 2))))
    assert read_map(write(tmp_path / "usual", grids))[0].cells.free.all()


@pytest.mark.parametrize("frame", ["odom", "base_link"])
def test_a_published_footprint(tmp_path, frame):
    corners = [(0.3, 0.2), (0.3, -0.2), (-0.1, -0.2), (-0.1, 0.2)]
    if frame == "odom":
        path = write_bag(tmp_path / "bag", T, circle(T), footprint=corners, corrected=[(5.0, (0.2, 0.1, 0.1))])
    else:
        path = write(tmp_path / "bag", [writing.polygon(START, corners, frame)])
    footprint = read_footprint(path, "/local_costmap/published_footprint")
    assert footprint.bounds == pytest.approx((-0.1, -0.2, 0.3, 0.2), abs=1e-4)
