"""Robots, tasks and runs that many tests share."""

import signal
from dataclasses import replace

import hypothesis
import pytest

from antdrive.base.errors import InputError
from antdrive.base.version import has_physics
from antdrive.planners import load_planner
from antdrive.robots import load_robot
from antdrive.sim import Scenario, run
from antdrive.worlds import Disc, Task, World
from tests.made_up_drive import made_up_drive as made_up_drive

hypothesis.settings.register_profile(
    "repeatable",
    max_examples=40,
    derandomize=True,
    deadline=None,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
hypothesis.settings.load_profile("repeatable")


@pytest.fixture(scope="session", autouse=True)
def compiling_is_silent():
    """`make test` compiles all kernels before. Without it, commands would print a line more than tests expect."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("antdrive.cli.groups.report_compiling", lambda: None)
        yield


@pytest.hookimpl(wrapper=True)
def _without_physics(item):
    """Skip a test that drives where PyBullet has no wheel."""
    try:
        return (yield)
    except InputError as error:
        if has_physics():
            raise
        pytest.skip(str(error))


pytest_runtest_setup = pytest_runtest_call = _without_physics

#: Words in the reason of every skip that is allowed; a test that is skipped for another reason fails.
MAY_SKIP = (
    # third-party data, which the repository does not hold
    "docs/how-to/data.md",
    "papers' texts",
    "texts of the papers",
    # the platform, its programs, its users and its switches
    "chromium", "python3.13", "POSIX", "root can write", "a user who", "needs fork", "begin as copies", "in /proc", "'resource'",
    "libyaml", "compiled kernels", "drives need PyBullet",
    # other planners, whose licences or wheels differ from the project's: GPL, or built by the reader's compiler
    "the extra `peers`",
    # packages of learning: stable-baselines3 brings 1 GB of torch
    "the extra `gym`", "stable-baselines3",
)  # fmt: skip


@pytest.hookimpl(wrapper=True)
def _without_other_skips(*_):
    """Turn a skip for an undeclared reason into a failure."""
    report = yield
    if report.skipped and not hasattr(report, "wasxfail") and not any(word in report.longrepr[2] for word in MAY_SKIP):
        report.outcome = "failed"
        report.longrepr = f"{report.longrepr[2]}: not in MAY_SKIP of tests/conftest.py; `make test` installs packages"
    return report


pytest_runtest_makereport = pytest_make_collect_report = _without_other_skips


@pytest.fixture
def signals():
    """Signals act as in a terminal, even where nohup or a background shell has them ignored; children inherit that."""
    usual = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL, signal.SIGHUP: signal.SIG_DFL}
    before = {one: signal.signal(one, action) for one, action in usual.items()}
    yield
    for one, action in before.items():
        signal.signal(one, action)


@pytest.fixture(scope="session")
def turtlebot():
    return load_robot("turtlebot")


@pytest.fixture(scope="session")
def jackal():
    return load_robot("jackal")


@pytest.fixture(scope="session", params=["turtlebot", "jackal"])
def spec(request):
    """Each of two robots: a disc and a rectangle."""
    return load_robot(request.param)


@pytest.fixture(scope="session")
def small_task():
    """A start and a goal with one cylinder between them."""
    world = World("small", (0.0, 0.0, 4.0, 3.0), (Disc(2.0, 1.5, 0.3),))
    return Task(world, (0.6, 1.4, 0.0), (3.4, 1.6), cell=0.2)


@pytest.fixture(scope="session")
def small_scenario(small_task, turtlebot):
    return Scenario(task=small_task, planner=load_planner("astar"), planner_name="astar", robot=turtlebot)


@pytest.fixture(scope="session")
def small_run(small_scenario):
    return run(small_scenario)


@pytest.fixture(scope="session")
def collided_run(small_scenario):
    """The small run again, with a cylinder on its way that the planner does not know of."""
    clean = run(small_scenario)
    x, y = clean.rollout.pose[len(clean.rollout.pose) // 2, :2]
    return run(replace(small_scenario, unseen=(Disc(float(x), float(y), 0.1),)))
