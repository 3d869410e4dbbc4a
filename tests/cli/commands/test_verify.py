"""`antdrive verify`."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from antdrive.base.files import as_json
from antdrive.sim import Scenario, run
from antdrive.sim.log.record import SensingRecord, differences, hashes_of
from antdrive.worlds import Disc, Wandering, save_task
from tests.records import changed


@pytest.fixture
def log(small_run, tmp_path):
    return small_run.rollout.save(tmp_path / "rollout.npz")


def test_a_log_is_about_the_given_world_and_robot(antdrive, log, small):
    code, out, _ = antdrive("verify", log, "--world", small, "--robot", "turtlebot", "--replay")
    assert code == 0, out
    assert "certified collision-free" in out
    assert "replayed bit for bit" in out
    assert f"about {small} and turtlebot" in out


def test_the_meaning_of_a_world_file_counts_not_its_text(antdrive, log, small):
    small.write_text("# another text\n" + small.read_text().replace("name: ", "name: other-"))
    assert antdrive("verify", log, "--world", small)[0] == 0


def test_a_log_of_another_world_or_robot_is_exit_code_1(antdrive, log, small_run, tmp_path):
    task = small_run.scenario.task
    save_task(replace(task, goal_tolerance=0.3), tmp_path / "other.yaml")
    code, out, _ = antdrive("verify", log, "--world", tmp_path / "other.yaml", "--robot", "jackal")
    assert code == 1
    assert "NOT verified" in out
    assert "  world: the log is about another one; its goal_tolerance differs" in out
    assert "  robot: the log is about another one; its footprint, " in out


def test_json_has_the_hashes_and_the_replay(antdrive, log):
    code, out, _ = antdrive("verify", log, "--replay", "--json")
    assert code == 0
    (found,) = json.loads(out)["rollouts"].values()
    assert set(found["hashes"]) == {"world", "robot", "settings"}
    assert all(len(value) == 64 for value in found["hashes"].values())
    assert found["replay"] == {"exact": True, "position_m": 0.0, "turn_rad": 0.0, "twist": 0.0}


def test_a_log_whose_commands_lead_elsewhere_is_exit_code_1(antdrive, small_run, tmp_path):
    command = small_run.rollout.command * [0.99, 1.0]
    path = replace(small_run.rollout, command=command).save(tmp_path / "forged.npz")
    assert antdrive("verify", path)[0] == 0, "the log alone does not show it"
    code, out, _ = antdrive("verify", path, "--replay")
    assert code == 1
    assert "  replay: the rerun differs in command, from t = 0." in out


def test_a_record_that_cannot_be_driven_is_a_problem_not_a_traceback(antdrive, small_run, tmp_path):
    odd = replace(small_run.rollout, record=replace(small_run.rollout.record, control_hz=70))
    code, out, _ = antdrive("verify", odd.save(tmp_path / "odd.npz"), "--replay")
    assert code == 1
    assert "control_hz: must divide the physics rate 240" in out


def test_the_folder_of_a_run_stands_for_its_log(antdrive, refused, log, tmp_path):
    code, out, _ = antdrive("verify", log.parent, "--json")
    assert code == 0
    assert list(json.loads(out)["rollouts"]) == [str(log)]
    code, out, _ = antdrive("margin", log.parent)
    assert code == 0
    assert out == antdrive("margin", log)[1].replace(f"{log}:", f"{log.parent}:")
    code, _, _ = antdrive("render", log.parent, "-o", "still.png", "--size", "160x160")
    assert code == 0
    assert Path("still.png").exists()
    log.unlink()
    (tmp_path / "result.json").write_text("{}")
    for command in (["verify"], ["margin"], ["render", "-o", "x.mp4"]):
        line = refused(command[0], tmp_path, *command[1:])
        assert f"{tmp_path}: contains no rollout.npz; its run ended before the robot drove" in line


def test_the_folder_of_a_run_is_verified_with_its_result(antdrive, refused, small_run, tmp_path):
    folder = tmp_path / "r"
    folder.mkdir()
    small_run.rollout.save(folder / "rollout.npz")
    for noise, code in ((0.0, 0), (0.5, 1)):
        (folder / "result.json").write_text(json.dumps({**small_run.as_dict(), "noise": noise}))
        assert antdrive("verify", folder)[0] == code
    assert "result.json: noise: differs from the log, which says 0.0" in antdrive("verify", folder)[1]
    assert antdrive("verify", folder / "rollout.npz")[0] == 0, "the log alone is genuine"
    result = folder / "result.json"
    result.write_text(result.read_text().replace('"noise":', '"noise": 0.0, "noise":'))
    assert f"{result}: cannot be read (noise: is given twice; keep one)" in refused("verify", folder)


def test_a_log_that_cannot_be_read_hides_no_other_verdict(antdrive, log, tmp_path):
    (tmp_path / "broken.npz").write_text("no log")
    words = ("verify", "missing.npz", log, tmp_path / "broken.npz", log.parent / "rollout.npz")
    code, out, err = antdrive(*words)
    assert code == 2
    assert f"{log}: certified collision-free" in out
    assert [line.split(":")[0] for line in err.splitlines()] == ["antdrive", "antdrive"]
    assert "missing.npz: no such file" in err
    code, out, _ = antdrive(*words, "--json")
    told = json.loads(out)
    assert (code, told["certified"]) == (2, False)
    assert {Path(path).name: found["certified"] for path, found in told["rollouts"].items()} == {
        "missing.npz": False,
        "rollout.npz": True,
        "broken.npz": False,
    }


MINE = '''
from dataclasses import dataclass
from antdrive.planners import AStar

@dataclass(frozen=True, kw_only=True)
class Mine(AStar):
    """A planner of a user."""
'''


def test_a_planner_of_a_user_is_given_or_the_replay_is_refused(small_scenario, tmp_path, antdrive):
    (tmp_path / "mine.py").write_text(MINE)
    words = f"{tmp_path / 'mine.py'}:Mine"
    path = run(Scenario.of(small_scenario.task, words, small_scenario.robot)).rollout.save(tmp_path / "rollout.npz")
    code, out, _ = antdrive("verify", path, "--replay", "--planner", words)
    assert code == 0
    assert "replayed bit for bit" in out
    code, out, _ = antdrive("verify", path, "--replay")
    assert code == 1
    assert "  replay: record.planner.name: 'Mine' is not registered" in out
    assert "--planner FILE.py:CLASS" in out


def test_a_planner_without_a_replay_or_a_registered_one_is_refused(antdrive, refused, small_run, tmp_path):
    path = small_run.rollout.save(tmp_path / "rollout.npz")
    assert "--planner: only the replay plans; add --replay" in refused("verify", path, "--planner", "mine.py:Mine")
    _, out, _ = antdrive("verify", path, "--replay", "--planner", small_run.scenario.planner_name)
    assert "planner: write FILE.py:CLASS or MODULE:CLASS, got " in out


def test_a_forged_optimum_needs_the_world_or_the_replay(antdrive, small_run, small, tmp_path):
    forged = replace(small_run.rollout, record=changed(small_run.rollout.record, "plan", euclidean_optimum_m=3.05))
    path = forged.save(tmp_path / "forged.npz")
    assert antdrive("verify", path)[0] == 0
    assert "  record.plan.euclidean_optimum_m: 3.05 m in the log, " in antdrive("verify", path, "--world", small)[1]
    assert "  replay: record.plan.euclidean_optimum_m: 3.05 in the log, " in antdrive("verify", path, "--replay")[1]


def test_results_that_the_log_contradicts_are_named(antdrive, small_run, tmp_path):
    small_run.rollout.save(tmp_path / "rollout.npz")
    result = json.loads(as_json(small_run.as_dict()))
    path = tmp_path / "result.json"
    path.write_text(json.dumps(result))
    assert antdrive("verify", tmp_path)[0] == 0
    for key, value in {"controller": {"blend": 9.0}, "unseen": [[1.0, 1.0, 0.1]]}.items():
        path.write_text(json.dumps({**result, "settings": {key: value}}))
        assert f"result.json: settings.{key}: differs from the log" in antdrive("verify", tmp_path)[1]
    rounded = {**result["metrics"], "duration_s": result["metrics"]["duration_s"] * (1 + 1e-12)}
    path.write_text(json.dumps({**result, "metrics": rounded}))
    assert antdrive("verify", tmp_path)[0] == 0


def test_a_certified_drive_that_failed_is_no_success(antdrive, small_scenario, tmp_path):
    timed_out = run(replace(small_scenario, time_limit=1.0))
    assert timed_out.certificate.certified
    timed_out.rollout.save(tmp_path / "rollout.npz")
    result = {**json.loads(as_json(timed_out.as_dict())), "succeeded": True}
    (tmp_path / "result.json").write_text(json.dumps(result))
    assert "result.json: succeeded: differs from the log" in antdrive("verify", tmp_path)[1]


def test_unseen_cylinders_are_other_worlds_where_movers_avoid_them(small_run):
    record = replace(small_run.rollout.record, unseen=(Disc(1.0, 1.0, 0.02),))
    assert list(differences(record, task=record.task)) == []
    world = replace(record.task.world, movers=(Wandering(radius=0.1, cell=0.5, period=2.0, start=(2.0, 2.0)),))
    record = replace(record, task=replace(record.task, world=world))
    assert "1 unseen cylinders more" in "".join(differences(record, task=record.task))


def test_hashes_of_settings_cover_sensing_and_unseen_cylinders(small_run):
    record = small_run.rollout.record
    sensing = SensingRecord(map="none", localisation="true", odometry=1.0)
    others = [replace(record, sensing=sensing), replace(record, sensing=replace(sensing, odometry=3.0))]
    others.append(replace(record, unseen=(Disc(1.0, 1.0, 0.02),)))
    assert len({hashes_of(one)["settings"] for one in [record, *others]}) == 4
