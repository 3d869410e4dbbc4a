"""Noise models: their statistics, their seeds, and a robot without noise."""

import math

import numpy as np
import pytest

from antdrive.base import InputError
from antdrive.robots import Noise, NoiseModel, RobotSpec, Twist, load_robot

DT = 1 / 60


def drive_straight(noise: Noise, seed: int, seconds: float = 20.0) -> tuple[np.ndarray, np.ndarray]:
    """True and estimated poses of a robot that is commanded to drive straight at 1 m/s, with no errors but the noise."""
    model = NoiseModel(noise, 0.3, DT, (0.0, 0.0, 0.0), np.random.default_rng(seed))
    pose, twist = (0.0, 0.0, 0.0), Twist(0.0, 0.0)
    poses, estimates = [], []
    for _ in range(round(seconds / DT)):
        estimates.append(model.estimate_pose(pose, twist))
        poses.append(pose)
        twist = model.actuate(Twist(1.0, 0.0))
        middle = pose[2] + twist.yaw_rate * DT / 2
        pose = (
            pose[0] + twist.speed * math.cos(middle) * DT,
            pose[1] + twist.speed * math.sin(middle) * DT,
            pose[2] + twist.yaw_rate * DT,
        )
    return np.array(poses), np.array(estimates)


def test_without_noise_the_estimate_is_exact_and_commands_are_obeyed() -> None:
    poses, estimates = drive_straight(Noise(), 0)
    np.testing.assert_allclose(estimates, poses, atol=1e-12)
    assert poses[-1, 0] == pytest.approx(20.0 - DT)


def test_commands_are_delayed_and_the_expected_pose_accounts_for_it() -> None:
    model = NoiseModel(Noise(delay=0.05), 0.3, DT, (0.0, 0.0, 0.0), np.random.default_rng(0))
    done = []
    for tick in range(6):
        model.estimate_pose((0.0, 0.0, 0.0), Twist(0.0, 0.0))
        if tick == 3:  # three commands are pending: 0.1, 0.2 and 0.3 m/s
            assert model.pose_after_delay()[0] == pytest.approx(0.6 * DT)
        done.append(model.actuate(Twist(0.1 * (tick + 1), 0.0)).speed)
    assert done == pytest.approx([0, 0, 0, 0.1, 0.2, 0.3])


def test_slip_has_its_standard_deviation_and_its_correlation_time() -> None:
    model = NoiseModel(Noise(slip=0.04), 0.3, DT, (0.0, 0.0, 0.0), np.random.default_rng(1))
    wheels = []
    for _ in range(60_000):
        v, w = model.actuate(Twist(1.0, 0.0))
        wheels.append((v - 0.15 * w - 1, v + 0.15 * w - 1))
    slip = np.array(wheels)
    assert slip.std(axis=0) == pytest.approx([0.04, 0.04], rel=0.1)
    late = round(0.5 / DT)
    kept = (slip[:-late] * slip[late:]).mean() / slip.var()
    assert kept == pytest.approx(math.exp(-1), abs=0.08)
    assert abs(np.corrcoef(slip.T)[0, 1]) < 0.1  # the wheels slip independently


def test_estimates_stay_near_the_truth_and_odometry_alone_does_not(jackal: RobotSpec) -> None:
    noise = jackal.noise
    errors = []
    for seed in range(5):
        poses, estimates = drive_straight(noise, seed)
        errors.append(np.hypot(*(estimates - poses)[60:, :2].T))
    rms = float(np.sqrt(np.mean(np.square(errors))))
    assert rms < noise.pose_xy  # the estimate is better than a single fix
    blind = Noise(encoder=noise.encoder, slip=noise.slip, pose_xy=1.0, pose_yaw=1.0, pose_rate=1.0)
    poses, estimates = drive_straight(blind, 0)
    assert np.hypot(*(estimates - poses)[-1, :2]) > 5 * rms


def test_the_same_seed_gives_the_same_noise_and_another_seed_gives_other(jackal: RobotSpec) -> None:
    first, again, other = (drive_straight(jackal.noise, seed, 2.0) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first[1], again[1])
    assert (first[1] != other[1]).any()


def test_scaling_multiplies_all_levels_and_leaves_the_rate_of_fixes() -> None:
    noise = Noise(pose_xy=0.01, slip=0.02, delay=0.1, pose_rate=5.0)
    half = noise.scaled(0.5)
    assert half == Noise(pose_xy=0.005, slip=0.01, delay=0.05, pose_rate=5.0)
    assert noise.nonzero
    assert not noise.scaled(0.0).nonzero


@pytest.mark.parametrize(("key", "value"), [("slip", 0.6), ("pose_xy", -0.1), ("delay", math.nan), ("pose_rate", 0.5)])
def test_impossible_levels_are_refused_by_name(key: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{key}: must be between"):
        Noise(**{key: value})


def test_a_robot_file_may_give_its_noise(tmp_path) -> None:
    from antdrive.robots import list_robots

    text = list_robots()["turtlebot"].read_text()
    path = tmp_path / "mine.yaml"
    path.write_text(text.replace("slip: 0.02", "slip: 0.1"))
    assert load_robot(path).noise.slip == 0.1
    path.write_text("\n".join(line for line in text.splitlines() if not line.startswith("noise")))
    assert not load_robot(path).noise.nonzero
    for wrong, key in (("slip: 2", "slip"), ("slop: 0.1", "slop"), ("slip: often", "slip")):
        path.write_text(text.replace("slip: 0.02", wrong))
        with pytest.raises(InputError, match=key) as error:
            load_robot(path)
        assert "mine.yaml" in str(error.value)
        assert "noise" in str(error.value)
