"""Foreign logs as runs: figures, films, exports, suites and baselines, and never in the words of a drive's certificate."""

import dataclasses
import json
import math
import shutil

import numpy as np
import pytest

from antdrive.base.errors import FieldError, InputError
from antdrive.base.plane import world_to_map
from antdrive.foreign.playback import ForeignRollout, foreign_run
from antdrive.foreign.setup import ForeignSetup
from antdrive.runs.suites import Baseline, suite_schema
from antdrive.runs.suites.scenarios import select
from antdrive.sim.log.certificate import certify
from antdrive.sim.log.outcome import Outcome
from antdrive.testing.evaluation import evaluate_case
from antdrive.views.colours import label_of
from antdrive.views.export.exporting import FOREIGN
from antdrive.views.figures.run_figures import overview
from antdrive.views.film.shot import caption
from antdrive.worlds.files.world_file import save_task
from tests.foreign.writing import write_bag

OURS = "collision-free"


def write_log(path, rollout, every=8, **more):
    pose = world_to_map(rollout.record.task.frame, rollout.pose)
    return write_bag(path, rollout.t[::every], pose[::every], **more)


@pytest.fixture(scope="module")
def made(tmp_path_factory, small_run, collided_run):
    """A folder with the logs of a drive and of one that touched a cylinder, and their worlds."""
    folder = tmp_path_factory.mktemp("logs")
    for name, run in (("drive", small_run), ("touched", collided_run)):
        write_log(folder / name, run.rollout, storage="mcap")
        save_task(dataclasses.replace(run.scenario.task, world=run.rollout.record.world), folder / f"{name}.yaml")
    return folder


@pytest.fixture
def folder(made, tmp_path, monkeypatch):
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def played(goal=None, **keys):
    setup = ForeignSetup(**{"log": "drive", "world": "drive.yaml"} | keys)
    return foreign_run(setup.certificate(), setup, goal)


def test_a_log_is_measured_where_it_tells(folder, small_run):
    run = played()
    log, metrics = run.rollout, run.metrics
    told = {name for name, value in metrics.items() if not math.isnan(value)}
    assert told == ForeignRollout.measured
    assert metrics["min_clearance_m"] == run.certificate.min_clearance
    for name in told:
        assert math.isclose(metrics[name], small_run.metric(name), rel_tol=0.01, abs_tol=0.01), name
    assert np.allclose(np.diff(log.t[:-1]), 1 / 60)
    assert certify(log) is run.certificate
    assert run.succeeded
    assert (log.outcome, len(log.contacts), len(log.route)) == (Outcome.SUCCEEDED, 0, 0)


def test_no_file_passes_for_the_log_of_a_drive(folder):
    with pytest.raises(FieldError, match="foreign log"):
        played().rollout.save("rollout.npz")


def test_a_goal_that_is_named_must_be_reached(folder):
    run = played(goal=(1.0, 1.0))
    assert (run.outcome, run.succeeded) == (Outcome.STOPPED, False)
    assert "m from the goal" in run.reason


def test_figures_and_films_show_the_foreign_statement(folder, tmp_path):
    sure, unsure = played().rollout, played(pose_error=0.5).rollout
    assert label_of(sure)[0] == "✓ PROVED CLEAR"
    assert label_of(unsure)[0] == "✕ NOT PROVED CLEAR"
    texts = {text.get_text() for text in overview(sure).findobj(lambda one: hasattr(one, "get_text"))}
    assert any("foreign log" in text for text in texts)
    assert not {"commanded", "route"} & texts
    for text in (*texts, caption(sure), caption(unsure)):
        assert OURS not in text


def test_another_robot_is_drawn_and_named(folder, small_run):
    log = small_run.rollout
    write_bag(folder / "beside", log.t[::5], log.pose[::5] + (0.0, 0.42, 0.0))
    run = played(others={"beside": "turtlebot"})
    assert run.rollout.movers.shape[1:] == (1, 2)
    assert np.allclose(run.rollout.movers[-1, 0], log.pose[-1, :2] + (0.0, 0.42), atol=1e-3)
    assert "turtlebot of beside" in run.certificate.nearest
    assert Baseline.of(run, "one[0]").nearest.thing == "turtlebot of beside"


@pytest.mark.parametrize("log", ["drive", "touched"])
def test_the_suite_that_init_writes_passes_and_speaks_of_no_drive(folder, antdrive, log, monkeypatch):
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(folder / "page.md"))
    code, out, err = antdrive("certify", log, "--map", f"{log}.yaml", "--init", "field.drive.yaml", "--out", "out")
    assert (code, err) == (int(log == "touched"), "")
    said = [out, (folder / "field.drive.yaml").read_text()]
    assert "Guessed, to be reviewed: robot, pose, map_frame, robot_frame" in said[1]
    assert "map_frame: map\n" in said[1]
    for words in ("accept", "check --keep --results results --junit junit.xml", "check --json"):
        code, out, _ = antdrive(*words.split(), "field.drive.yaml")
        assert code == 0, out
        said.append(out)
    written = [one for one in folder.rglob("*") if one.suffix in (".json", ".md", ".xml", ".txt", ".yaml")]
    assert {"certificate.json", "junit.xml", "page.md", "result.json"} <= {one.name for one in written}
    assert len([*folder.rglob("drive.html")]) == 1
    assert not [*folder.rglob("rollout.npz")]
    for text in (*said, *(one.read_text() for one in written)):
        assert OURS not in text
    assert json.loads((folder / "out" / "certificate.json").read_text())["kind"] == "foreign"


def test_a_worse_log_fails_in_its_own_words(folder, antdrive):
    antdrive("certify", "drive", "--map", "drive.yaml", "--init", "field.drive.yaml")
    antdrive("accept", "field.drive.yaml")
    shutil.rmtree("drive")
    shutil.move("touched", "drive")
    shutil.move("touched.yaml", "drive.yaml")
    code, out, _ = antdrive("check", "field.drive.yaml")
    assert code == 1
    assert "outcome: collided, expected succeeded (the robot touched obstacles[1]" in out
    assert "changed since the baseline: world, log" in out
    assert "limits the speed" not in out
    assert OURS not in out


def test_a_failed_proof_is_a_fault(folder):
    case = suite_of(folder, "{log: {file: drive, pose_error: 0.5}, world: drive.yaml, baseline: false}")
    (fault,) = evaluate_case(case).faults
    assert fault.startswith("certificate: not proved clear, as assumed (poses are off by up to 0.5000 m")


@pytest.mark.parametrize(
    ("entry", "problem"),
    [
        ("{log: drive, seeds: 0-3}", "one.seeds: is for drives; omit it beside log"),
        ("{log: drive, planner: astar}", "one.planner: is for drives; omit it beside log"),
        ("{log: drive, noise: 1.0}", "one.noise: is for drives; omit it beside log"),
        ("{log: drive, world: {generate: forest}}", "one.world: must be a file or a world of the catalogue"),
        ("{log: nothing.mcap}", "one.log: nothing.mcap does not exist"),
        ("{log: {file: drive, poze: /x}}", "one.log.poze: unknown key; did you mean pose?"),
        ("{log: {pose: /x}}", "one.log.file: missing"),
        ("{log: {file: drive, pose_error: x}}", 'one.log.pose_error: must be a number, got "x"'),
        ("{world: drive.yaml, pose: /x}", "one.pose: unknown key; write log:"),
        ("{log: {file: drive, pose_error: -1}, world: drive.yaml}", "one.log.pose_error: must be at least 0 m, got -1"),
        ("{log: drive, world: nowhere.yaml}", "one.world: "),
    ],
)
def test_wrong_entries_are_named_by_line(folder, entry, problem):
    with pytest.raises(InputError) as error:
        suite_of(folder, entry).run()
    assert str(error.value).startswith(f"{folder / 's.drive.yaml'}:3: scenarios.{problem}")
    assert "\n" not in str(error.value)


def test_settings_of_the_defaults_are_for_drives_alone(folder):
    case = suite_of(
        folder, "{log: drive, world: drive.yaml, baseline: false}\ndefaults: {noise: 1, seeds: 0-4, planner: astar}"
    )
    assert (case.id, evaluate_case(case).faults) == ("one[0]", ())


def test_the_schema_of_suites_has_the_keys_of_logs():
    schema = suite_schema()
    keys = schema["$defs"]["LogEntry"]["properties"]
    assert {"file", "pose", "map_frame", "robot_frame", "footprint", "others", "pose_error", "unknown"} == set(keys)
    assert {"type": "string"} in schema["$defs"]["ScenarioEntry"]["properties"]["log"]["anyOf"]


def test_a_log_exports_with_its_certificate_and_nothing_invented(folder, antdrive):
    from mcap.reader import make_reader

    code, _, err = antdrive("certify", "drive", "--map", "drive.yaml", "--export", "log.mcap")
    assert (code, err) == (0, "")
    with open("log.mcap", "rb") as file:
        reader = make_reader(file)
        topics = {channel.topic for channel in reader.get_summary().channels.values()}
        attached = {one.name: one.data for one in reader.iter_attachments()}
    assert topics == set(FOREIGN) - {"/movers"}
    assert attached.keys() == {"certificate.json"}
    assert json.loads(attached["certificate.json"])["kind"] == "foreign"


def suite_of(folder, entry):
    path = folder / "s.drive.yaml"
    path.write_text(f"schema: 1\nscenarios:\n  one: {entry}\n")
    (case,) = select([str(path)])
    return case


def test_a_table_of_a_robot_that_starts_in_another_becomes_a_bag_and_a_suite(folder, antdrive, small_run):
    pose = world_to_map(small_run.rollout.record.task.frame, small_run.rollout.pose)
    rows = np.column_stack([small_run.rollout.t, pose])[::8]
    np.savetxt("own.csv", rows, delimiter=",", header="t,x,y,yaw", comments="")
    np.savetxt("next.csv", rows + (0.0, 0.1, 0.0, 0.0), delimiter=",", header="t,x,y,yaw", comments="")
    words = ("--other", "next.csv=turtlebot", "--export", "log.mcap", "--init", "s.drive.yaml")
    code, _, err = antdrive("certify", "own.csv", "--map", "drive.yaml", *words)
    assert (code, err) == (1, "")
    suite = (folder / "s.drive.yaml").read_text()
    assert "      robot_frame" not in suite
