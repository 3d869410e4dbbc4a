"""Foreign certificates: what is proved, what cannot be said, and what is wrong in one line."""

import json
import math

import numpy as np
import pytest
import yaml
from PIL import Image

from antdrive import InputError
from antdrive.foreign.setup import ForeignSetup
from antdrive.worlds import Disc, Task, World, save_task
from tests.foreign.writing import grid, polygon, transforms, write

T = np.arange(0.0, 4.01, 0.05)
LINE = np.column_stack([1.0 + 0.5 * T, np.full_like(T, 1.0), np.zeros_like(T)])  # along y = 1 at 0.5 m/s
PILLAR = Disc(2.0, 1.5, 0.1)  # 0.4 m from the line: 0.22 m from the turtlebot


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    hall = World("hall", (0.0, 0.0, 4.0, 3.0), (PILLAR,))
    save_task(Task(hall, (1.0, 1.0, 0.0), (3.0, 1.0)), tmp_path / "hall.yaml")
    return tmp_path


def table(path, t=T, pose=LINE):
    rows = "\n".join(",".join(map(repr, row)) for row in np.column_stack([t, pose]).tolist())
    path.write_text(f"t,x,y,yaw\n{rows}\n")
    return path.name


def found(here, t=T, pose=LINE, **more):
    return ForeignSetup(log=table(here / "log.csv", t, pose), **{"world": "hall.yaml"} | more).certificate()


def test_a_drive_past_a_pillar_is_proved_clear_with_the_largest_error_of_its_poses(here):
    done = found(here)
    assert (done.certified, done.problems) == (True, ())
    assert done.min_clearance == pytest.approx(0.22)
    assert 0.20 < done.bound < 0.22
    assert done.nearest.startswith("obstacles[0] at (2, 1.5) with radius 0.1: 0.2200 m at t = 2.000 s")
    assert 0.15 < done.most_error < done.bound
    assert found(here, pose_error=done.most_error - 1e-6).certified
    worse = found(here, pose_error=0.22)
    assert (worse.certified, worse.touched) == (False, False)
    assert f"the robot is clear below {done.most_error:.4f} m" in worse.problems[0]
    assert json.loads(json.dumps(done.as_dict()))["kind"] == "foreign"


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (0.0, "with radius 0.1: overlapped by 0.0800 m"),
        (0.2, "contact cannot be ruled out"),
    ],
)
def test_an_overlap_is_a_touch_unless_the_poses_may_be_that_far_off(here, error, said):
    done = found(here, pose=LINE + (0.0, 0.3, 0.0), pose_error=error)
    assert (done.touched, done.certified) == (error == 0.0, False)
    assert said in done.problems[0]


def test_a_gap_is_not_bridged_and_named(here):
    keep = (T < 1.5) | (T > 2.4)
    done = found(here, T[keep], LINE[keep])
    assert (done.certified, done.touched) == (False, False)
    assert "contact cannot be ruled out between t = " in done.problems[0]
    assert any("gap" in finding for finding in done.log.findings)


def test_a_correction_is_no_motion_but_shows_an_error(here):
    jump = LINE + np.where(T > 3.0, 0.5, 0.0)[:, None] * (0.0, -1.0, 0.0)
    done = found(here, pose=jump)
    assert done.shown_error == pytest.approx((math.hypot(0.5, 0.025) - 0.7 * 0.05) / 2)
    assert "poses are off by at least 0.2328 m, since they lie too far apart for top speeds" in done.problems[0]
    assert any("correct" in finding for finding in done.log.findings)


def test_poses_that_contradict_the_limits_show_an_error(here):
    turned = LINE + np.where(T > 3.0, 3.0, 0.0)[:, None] * (0.0, 0.0, 1.0)
    assert found(here, pose=turned).shown_error == pytest.approx(0.18 * math.sin((3.0 - 3.14 * 0.05) / 4), abs=1e-3)
    hasty = found(here, T / 1000)  # each step is short, all together are not
    assert not hasty.certified
    assert hasty.shown_error == pytest.approx((0.5 * 3.2 - 0.7 * 0.0032) / 2)
    table(here / "hasty.csv", T / 1000, LINE + (0.0, 1.2, 0.0))
    assert not found(here, others={"hasty.csv": "turtlebot"}).certified


def test_an_overlap_below_the_error_that_the_log_shows_is_no_touch(here):
    jump = LINE + np.where((T > 1.9) & (T < 2.1), 0.3, 0.0)[:, None] * (0.0, 1.0, 0.0)
    done = found(here, pose=jump)
    assert (done.touched, done.certified) == (False, False)
    assert found(here, pose=LINE + (0.0, 0.3, 0.0)).touched


def test_nothing_is_said_of_a_step_whose_time_is_unknown(here):
    t = np.where(T > 2.0, T - 100.0, T)
    done = found(here, t)
    assert not done.certified
    assert "nothing can be said between" in done.problems[0]
    assert done.as_dict()["bound_m"] is None


def test_other_robots_count_while_their_logs_last(here):
    table(here / "far.csv", T + 0.01, LINE + (0.0, 1.2, 0.0))
    table(here / "near.csv", T[20:], LINE[::-1][20:] + (0.0, 0.6, math.pi))
    table(here / "later.csv", T + 1e6, LINE)
    far, near = (found(here, others={name: "turtlebot"}, world="empty") for name in ("far.csv", "near.csv"))
    assert far.certified
    assert far.assumptions[-1].startswith("turtlebot of far.csv was elsewhere before t = 0.010 s")
    assert "turtlebot of near.csv" in near.nearest
    assert near.min_clearance == pytest.approx(0.24, abs=1e-3)
    apart = found(here, others={"near.csv": "jackal"}, pose=LINE - (0.0, 0.5, 0.0))  # no disc, and absent at first
    assert (apart.touched, apart.certified) == (False, True)
    assert "jackal of near.csv kept its limits and error too" in " ".join(apart.assumptions)
    with pytest.raises(InputError, match=r"later.csv: has no time in common with .*log.csv"):
        found(here, others={"later.csv": "turtlebot"})


def served(here, cells, **more):
    Image.fromarray(cells[::-1].astype(np.uint8)).save(here / "map.png")
    about = {"image": "map.png", "resolution": 0.05, "origin": [0.0, 0.0, 0.0], "negate": 0}
    about |= {"occupied_thresh": 0.65, "free_thresh": 0.196} | more
    (here / "map.yaml").write_text(yaml.safe_dump(about))
    return found(here, world="map.yaml")


def test_a_map_counts_blocked_and_unknown_cells_and_those_inside_walls(here):
    cells = np.full((60, 80), 254)
    cells[30:, 40:42] = 0  # a wall above y = 1.5
    assert served(here, cells).min_clearance == pytest.approx(0.5 - 0.18, abs=0.02)
    cells[30:, 40:42] = 205
    assert served(here, cells).min_clearance == pytest.approx(0.5 - 0.18, abs=0.02)
    assert found(here, world="map.yaml", unknown="free").min_clearance > 0.8
    cells[10:30, 38:44] = 0  # a block across the line, thicker than the cells that are covered
    assert served(here, cells).touched
    inside = np.zeros((60, 80))
    inside[:8] = 254
    assert served(here, inside).touched  # deep inside a wall, no pose is beside a free cell


def test_a_rotated_map_is_the_same_map(here):
    cells = np.full((80, 60), 254)
    cells[38:40, 30:] = 0  # in the map's frame the same wall
    done = served(here, cells, origin=[4.0, 0.0, math.pi / 2])
    assert done.min_clearance == pytest.approx(0.5 - 0.18, abs=0.02)


def test_a_bag_brings_its_own_map_and_footprint(here):
    cells = np.zeros((60, 80))
    cells[30:, 40:42] = 100
    square = polygon(1.0, [(0.2, 0.2), (-0.2, 0.2), (-0.2, -0.2), (0.2, -0.2)], frame="base_link", topic="/footprint")
    sent = [*transforms(1000 + T, "map", "base_link", LINE), grid(1000, cells), square]
    bag = write(here / "drive", sent)
    own = ForeignSetup(log=bag.name).certificate()
    assert own.min_clearance == pytest.approx(0.5 - 0.18, abs=0.02)
    boxed = ForeignSetup(log=bag.name, footprint="/footprint").certificate()
    assert boxed.min_clearance == pytest.approx(0.5 - 0.2, abs=0.02)
    assert "the map in drive" in boxed.world.source


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"world": "hal.yaml"}, "hal.yaml: no such file or world"),
        ({"robot": "turtle"}, "turtle: no such file or robot"),
        ({"pose_error": -1.0}, "pose_error: must be at least 0 m"),
        ({"unknown": "maybe"}, "unknown: must be blocked or free"),
        ({"world": None}, "log.csv: only bags bring a map or an outline; name one: --map"),
        ({"others": {"/tracked": "turtlebot"}}, "log.csv"),
        ({"others": {"missing.csv": "turtlebot"}}, "missing.csv"),
        ({"footprint": "/footprint"}, "log.csv: only bags bring a map or an outline; omit --footprint"),
    ],
)
def test_what_is_wrong_is_one_line(here, more, said):
    with pytest.raises((InputError, ValueError)) as caught:
        found(here, **more)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_poses_beside_the_map_are_refused(here):
    with pytest.raises(InputError, match=r"81 of 81 poses are not on it, the first at t = 0\.000 s"):
        served(here, np.full((20, 20), 254))
