"""Controllers in scenarios: names, options, records, keys, replays, and errors of user code."""

import dataclasses
import importlib.metadata
import math
import re
from pathlib import Path

import pytest

from antdrive.base import FieldError, InputError
from antdrive.base.optional import CONTROLLER_GROUP
from antdrive.base.user_code import LOADED
from antdrive.robots import CONTROLLERS, ControllerError, PurePursuit, Twist, list_controllers
from antdrive.robots.controllers.dwa import DynamicWindow
from antdrive.robots.controllers.stanley import Stanley
from antdrive.runs.campaigns import expand, make_campaign, sweep
from antdrive.runs.campaigns.results import read_runs
from antdrive.runs.campaigns.running import Driving
from antdrive.runs.comparing import Compared
from antdrive.sim import Scenario, run
from antdrive.sim.recorded import false_words, rebuilt, written_of
from antdrive.sim.rerun import rerun
from antdrive.sim.verifying import false_claims
from antdrive.sim.written import Written
from antdrive.worlds import Disc, Task, World

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "plugin_planner"
SHORT = Task(World("short", (0.0, 0.0, 6.0, 4.0)), (1.0, 2.0, 0.4), (4.0, 2.0))

FOLLOWER = '''
import math
from dataclasses import dataclass

from antdrive.base import wrap_angle
from antdrive.robots import Twist


@dataclass(frozen=True, kw_only=True)
class Proportional:
    """Steer towards a point of the path in proportion to its bearing."""

    gain: float = 2.0

    def start(self, briefing, path):
        return 0.0

    def step(self, now, path, arc):
        arc = path.nearest(now.pose, arc)
        x, y = path.carrot(now.pose, arc, 0.4)
        bearing = wrap_angle(math.atan2(y - now.pose[1], x - now.pose[0]) - now.pose[2])
        return Twist(path.speed_limit(arc) * max(0.0, math.cos(bearing)), self.gain * bearing), arc


class Faulty(Proportional):
    def step(self, now, path, arc):
        if now.tick > 20:
            return self.fault()
        return super().step(now, path, arc)


class Raises(Faulty):
    def fault(self):
        raise ValueError("lost the path")


class Endless(Faulty):
    def fault(self):
        while True:
            pass


class NotFinite(Faulty):
    def fault(self):
        return Twist(float("nan"), 0.0), 0.0


class Shapeless(Faulty):
    def fault(self):
        return 1.0, 2.0, 3.0


class Wordy(Faulty):
    def fault(self):
        return ("fast", 0.0), 0.0


class Exits(Faulty):
    def fault(self):
        raise SystemExit(0)


class Unready(Proportional):
    def start(self, briefing, path):
        return briefing.nothing


class Incapable(Proportional):
    capabilities = 7


class Lacking:
    def start(self, briefing, path):
        return 0.0


class Narrow(Proportional):
    def step(self, now):
        return None
'''


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(FOLLOWER)
    return tmp_path


def scenario(controller, **settings):
    return Scenario.of(SHORT, "astar", controller=controller, **settings)


@pytest.mark.parametrize("name", CONTROLLERS)
def test_every_controller_drives_to_the_goal_and_again_bit_for_bit(name):
    driven = run(scenario(name))
    assert driven.succeeded
    assert rerun(driven.rollout).drive_digest == driven.rollout.drive_digest


@pytest.mark.parametrize("name", CONTROLLERS)
def test_a_record_names_the_controller_and_its_options(name):
    record = run(scenario(name)).rollout.record
    assert record.controller.name == ("PurePursuit" if name == "pure-pursuit" else name)
    assert {*record.controller.settings} == {one.name for one in dataclasses.fields(CONTROLLERS[name])}
    assert rebuilt(record).controller == CONTROLLERS[name]
    assert not list(false_words(record, settings=True))


def test_a_result_that_names_another_controller_is_found():
    driven = run(scenario("dwa"))
    for named, wrong in (({"name": "dwa"}, 0), ({"name": "coulter"}, 1), ({"name": "dwa", "reach": 9.0}, 1)):
        claims = {**driven.as_dict(), "settings": {"controller": named}}
        assert len([*false_claims(claims, driven.logged)]) == wrong


def test_options_without_a_name_are_those_of_pure_pursuit():
    old, new = ({"lookahead_time": 0.5}, {"name": "pure-pursuit", "lookahead_time": 0.5})
    assert scenario(old).controller == scenario(new).controller == PurePursuit(lookahead_time=0.5)
    assert scenario(old).key == scenario(PurePursuit(lookahead_time=0.5)).key
    assert scenario(new).written.settings == {"controller": {"lookahead_time": 0.5}}


@pytest.mark.parametrize("given", [Stanley(), Stanley(gain=3.0), DynamicWindow(reach=1.0), PurePursuit(braking=0.5)])
def test_words_and_commands_of_a_controller_give_it_again(given):
    s = scenario(given)
    words = s.written
    assert Written.read(words.plain()).settings == words.settings
    assert scenario(words.settings["controller"]).controller == given


def test_keys_tell_controllers_and_their_options_apart(folder):
    keys = {scenario(one).key for one in (*CONTROLLERS, {"name": "dwa", "reach": 1.0}, "mine.py:Proportional")}
    assert len(keys) == len(CONTROLLERS) + 2


def test_a_key_depends_on_the_file_of_a_controller(folder):
    first = scenario("mine.py:Proportional").key
    (folder / "mine.py").write_text(FOLLOWER.replace("0.4)", "0.5)"))
    assert scenario("mine.py:Proportional").key != first


def test_a_follower_of_ones_own_drives_and_is_named(folder):
    driven = run(scenario({"name": "mine.py:Proportional", "gain": 3.0}))
    assert driven.succeeded
    assert driven.rollout.record.controller.name == "Proportional"
    assert driven.as_dict()["settings"] == {"controller": {"name": "Proportional", "gain": 3.0}}
    assert not [*false_claims(driven.as_dict(), driven.logged)]
    command = written_of(driven.rollout.record).command()
    assert "--controller mine.py:Proportional --set controller.gain=3.0" in command


def test_a_log_of_user_code_is_driven_again_only_with_the_named_class(folder):
    log = run(scenario("mine.py:Proportional")).rollout
    LOADED.clear()  # as in another process
    with pytest.raises(InputError, match=r"'Proportional' is not registered.*--controller FILE\.py:CLASS"):
        rerun(log)
    with pytest.raises(InputError, match="the log's controller is 'Proportional', not 'Raises'"):
        rerun(log, controller="mine.py:Raises")
    assert rerun(log, controller="mine.py:Proportional").drive_digest == log.drive_digest


def test_a_log_that_names_a_users_file_for_a_built_in_controller_is_refused_without_reading_it(folder):
    record = run(scenario("pure-pursuit")).rollout.record
    forged = dataclasses.replace(record, written={**record.written, "controller": "absent.py:Mine"})
    assert list(false_words(forged, settings=True)) == ["record.written.controller: contradicts the rest of the record"]


FAULTS = {
    "Raises": "raised ValueError: lost the path (mine.py:34)",
    "NotFinite": "returned Twist(speed=nan, yaw_rate=0.0) instead of a Twist of two finite numbers",
    "Shapeless": "returned (1.0, 2.0, 3.0) instead of (Twist, state)",
    "Wordy": "returned ('fast', 0.0) instead of a Twist of two finite numbers",
    "Exits": "raised SystemExit: 0",
    "Unready": "raised AttributeError",
    "Incapable": "declares 7 instead of ControllerCapabilities",
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_faulty_controller_is_named_with_its_place(name, folder):
    with pytest.raises(ControllerError) as error:
        run(scenario(f"mine.py:{name}"))
    assert str(error.value).startswith(f"controller {name} ")
    assert FAULTS[name] in str(error.value)
    assert name == "Incapable" or "(mine.py:" in str(error.value)


def test_an_endless_controller_ends_at_the_limit(folder, monkeypatch):
    monkeypatch.setenv("ANTDRIVE_PLAN_LIMIT", "0.3")
    with pytest.raises(ControllerError, match=r"controller Endless took longer than the limit of 0\.3 s \(mine\.py"):
        run(scenario("mine.py:Endless"))


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("mine.py:Lacking", "it has no methods start(briefing, path) and step(now, path, state)"),
        ("mine.py:Narrow", "its method must be step(now, path, state)"),
        ("mine.py:Proportonal", "did you mean Proportional?"),
        ("stanly", "did you mean stanley?"),
        ("absent.py:Mine", "absent.py"),
        ({"name": 3}, "must be a name"),
        ({"name": "stanley", "gian": 1.0}, "did you mean gain?"),
        ({"name": "stanley", "gain": -1.0}, "must be between"),
    ],
)
def test_a_controller_that_cannot_be_made_is_invalid_input(name, problem, folder):
    with pytest.raises((InputError, FieldError)) as error:
        scenario(name)
    assert error.value.key.startswith("controller")
    assert problem in str(error.value)


@pytest.mark.parametrize("value", [3, Stanley, object()])
def test_only_controllers_are_controllers(value):
    with pytest.raises(FieldError, match="controller: must be a controller, such as PurePursuit"):
        scenario(value)


def test_a_package_adds_a_controller(monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLE))
    project = (EXAMPLE / "pyproject.toml").read_text()
    name, value = re.search(rf'entry-points."{CONTROLLER_GROUP}"\]\n(\w+) = "(.+)"', project).groups()
    added = importlib.metadata.EntryPoint(name, value, CONTROLLER_GROUP)
    monkeypatch.setattr("importlib.metadata.entry_points", lambda group: [added] if group == CONTROLLER_GROUP else [])
    assert "steady" in list_controllers()
    driven = run(scenario({"name": "steady", "gain": 3.0}))
    assert driven.succeeded
    assert driven.rollout.record.controller.name == "steady"
    assert rerun(driven.rollout).drive_digest == driven.rollout.drive_digest


def test_a_campaign_lists_controllers_and_names_their_faults(folder):
    listed = ["pure-pursuit", "coulter", {"name": "dwa", "reach": 1.0}, "mine.py:Proportional", "mine.py:Raises"]
    data = {"worlds": ["empty"], "planners": ["astar"], "settings": {"controller": listed, "time_limit": 1.0}}
    expansion = expand(make_campaign(data, folder))
    jobs, ((copy, file),) = expansion.jobs, expansion.codes.items()
    assert f"--controller {copy}:Raises" in jobs[-1].case.written.command()
    assert (copy.partition("/")[0], file) == ("controllers", folder / "mine.py")
    names = [job.case.resolved.columns["controller"] for job in jobs]
    assert names == ["default", "coulter", "dwa reach=1.0", "Proportional", "Raises"]
    assert [Driving()(job).row["outcome"] for job in jobs] == ["timed_out"] * 4 + ["controller_fault"]


def test_a_comparison_reports_a_fault_of_the_controller(folder):
    s = scenario("mine.py:Raises")
    with pytest.raises(ControllerError) as error:
        run(s)
    assert Compared.of("one", s, error.value, None).facts["outcome"] == "controller_fault"


def test_a_footprint_needs_a_controller_that_turns():
    with pytest.raises(FieldError, match="exact: stanley follows no routes with turns on the spot"):
        Scenario.of("forest", "astar", "jackal", controller="stanley", footprint="exact")


def test_a_subclass_of_pure_pursuit_drives_by_its_own_code():
    class Slow(PurePursuit):
        def step(self, now, path, state):
            command, state = super().step(now, path, state)
            return command._replace(speed=0.1), state

    s = scenario(Slow(), time_limit=1.0)
    assert s.key != scenario("pure-pursuit", time_limit=1.0).key
    assert run(s).rollout.command[:, 0].max() <= 0.1


def test_dwa_looks_past_the_ends_of_walls_and_not_through_them():
    assert run(Scenario.of("slalom", "astar", controller="dwa")).succeeded


def test_dwa_gives_way_to_a_mover_without_local_avoidance():
    driven = run(Scenario.of("people-crossing", "astar", controller="dwa"))
    assert "avoid" not in {driven.rollout.record.limiters[k] for k in set(driven.rollout.limiter.tolist())}


def test_commands_of_a_controller_are_limited_to_what_the_robot_can_reach(folder):
    (folder / "wild.py").write_text(FOLLOWER.replace("self.gain * bearing", "math.copysign(1e9, math.sin(99 * now.t))"))
    log = run(scenario("wild.py:Proportional", time_limit=2.0)).rollout
    assert math.isfinite(float(abs(log.command).max()))
    assert abs(log.command[:, 1]).max() <= log.record.robot.max_yaw_rate + 1e-9


def test_a_state_starts_again_on_a_new_path():
    starts = []

    @dataclasses.dataclass(frozen=True)
    class Counting:
        def start(self, briefing, path):
            starts.append(briefing.map)
            return 0.0

        def step(self, now, path, arc):
            return Twist(0.2, 0.0), arc

    s = Scenario.of("forest", "astar", "turtlebot4", map="none", controller=Counting(), time_limit=8.0)
    log = run(s).rollout
    assert len(starts) == 1 + sum(one.solved for one in log.record.replans)
    assert not any(starts)  # a mapless robot has no map


def test_a_briefing_holds_neither_movers_nor_unseen_obstacles():
    given = []

    @dataclasses.dataclass(frozen=True)
    class Reading:
        def start(self, briefing, path):
            given.append(briefing.map)

        def step(self, now, path, state):
            return Twist(0.0, 0.0), state

    run(Scenario.of("people-crossing", "astar", controller=Reading(), unseen=(Disc(1.0, 1.0, 0.05),), time_limit=0.2))
    assert not given[0].movers
    assert Disc(1.0, 1.0, 0.05) not in given[0].obstacles


@pytest.mark.parametrize("name", ["PurePursuit", "dwa", "Session"])
def test_a_class_with_the_name_of_a_built_in_controller_is_refused(name, folder):
    (folder / "named.py").write_text(f"{FOLLOWER}\n\nclass {name}(Proportional):\n    pass\n")
    with pytest.raises(InputError, match="rename the class"):
        scenario(f"named.py:{name}")


def test_what_a_controller_remembers_about_itself_stays_in_its_drive():
    class Counting:
        steps = 0

        def start(self, briefing, path):
            return None

        def step(self, now, path, state):
            self.steps += 1
            return Twist(0.1 * (self.steps % 3), 0.0), None

    s = scenario(Counting(), time_limit=0.5)
    assert run(s).rollout.digest == run(s).rollout.digest


def test_a_campaign_over_controllers_is_compared_by_controller(folder):
    data = {"worlds": ["empty"], "planners": ["astar"], "settings": {"controller": [*CONTROLLERS], "time_limit": 0.5}}
    results = sweep(data, folder / "out", jobs=0)
    table, size = read_runs([results.folder], {}, [])
    assert (dict.fromkeys(table.columns["planner"]), size) == (
        dict.fromkeys(f"astar with {name}" for name in CONTROLLERS),
        len(CONTROLLERS),
    )
    assert read_runs([results.folder], {"controller": "dwa"}, [])[0].columns["planner"] == ["astar"]
