"""World files: reading, validation and writing."""

import json
import math
import os
import stat
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from antdrive.base import InputError
from antdrive.base.caches import clear_caches
from antdrive.base.document import parse_document
from antdrive.worlds import (
    Disc,
    Task,
    World,
    load_task,
    load_tasks,
    save_task,
    task_from_dict,
    task_schema,
    task_to_dict,
)
from tests.worlds.malformed import GOOD

TASK = Task(
    World("one", (0.0, 0.0, 10.0, 8.0), (Disc(5.0, 4.0, 1.0), Disc(2.5, 6.125, 0.5, 2.0)), "made up"),
    (1.0, 1.0, math.pi / 2),
    (9.0, 7.0),
    0.3,
    0.25,
)


def write(folder, content, name="bad.yaml"):
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def refusal(call):
    """The message of the InputError, if there is one."""
    try:
        call()
    except InputError as error:
        return str(error)
    return None


# Refused files


def test_the_unchanged_file_of_the_malformed_ones_is_read(tmp_path):
    assert load_task(write(tmp_path, GOOD)).world.name == "bad"


@given(st.text(max_size=200))
@example("\ud800")
@example("a: &a [*a]")
@example("? ? ?")
@settings(max_examples=100)
def test_any_text_is_a_document_or_an_input_error(text):
    message = refusal(lambda: parse_document(text, "text"))
    assert message is None or (message.startswith("text") and message.isprintable())


plain = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=8,
)


@given(plain, st.sampled_from([*task_to_dict(TASK), "movers", "other"]))
def test_any_value_for_any_key_is_a_task_or_an_input_error(value, key):
    message = refusal(lambda: task_from_dict(task_to_dict(TASK) | {key: value}))
    assert message is None or (message.startswith(f"task: {key}") and message.isprintable())


def test_a_name_that_no_file_can_have_gets_a_message_of_one_line():
    assert refusal(lambda: load_task("x" * 5000)).isprintable()


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="needs a user who may not read everything")
def test_a_file_that_may_not_be_read_says_so(tmp_path):
    path = write(tmp_path, GOOD)
    path.chmod(0)
    with pytest.raises(InputError, match="cannot be read: Permission denied"):
        load_task(path)


def test_a_dangling_link_is_a_missing_file(tmp_path):
    (tmp_path / "link.yaml").symlink_to(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"no such file"):
        load_task(tmp_path / "link.yaml")


# Accepted files


def test_whole_numbers_are_numbers(tmp_path):
    text = GOOD.replace("0.0, 0.0, 10.0, 10.0", "0, 0, 10, 10").replace("cell: 0.5", "cell: 1")
    task = load_task(write(tmp_path, text))
    assert task.world.bounds == (0.0, 0.0, 10.0, 10.0)
    assert isinstance(task.world.bounds[2], float)
    assert task.cell == 1.0


def test_omitted_keys_get_their_defaults(tmp_path):
    text = "schema: 1\nbounds: [0, 0, 9, 9]\nstart: [1, 1, 0]\ngoal: [8, 8]\nmovers: []\n"
    task = load_task(write(tmp_path, text, "my world.yaml"))
    assert task.world == World("my world", (0.0, 0.0, 9.0, 9.0))
    assert (task.goal_tolerance, task.cell) == (0.25, 0.5)


def test_a_byte_order_mark_and_windows_lines_are_fine(tmp_path):
    assert load_task(write(tmp_path, b"\xef\xbb\xbf" + GOOD.replace("\n", "\r\n").encode())).world.name == "bad"


def test_harmless_aliases_are_followed(tmp_path):
    text = GOOD.replace("radius: 0.5", "radius: &r 0.5") + "  - {x: 7.0, y: 5.0, radius: *r}\n"
    assert [d.radius for d in load_task(write(tmp_path, text)).world.obstacles] == [0.5, 0.5]


def test_a_catalogue_name_wins_over_a_file_of_that_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write(tmp_path, GOOD, "gate")
    assert load_task("gate").world.name == "gate"
    assert load_task("./gate").world.name == "bad"
    assert load_task(Path("gate")).world.name == "bad"


# Written files

numbers = st.floats(-1e6, 1e6, allow_nan=False)
sizes = st.floats(1e-300, 1e6)
names = st.text(min_size=1, max_size=30).filter(str.isprintable)


@st.composite
def tasks(draw):
    start = (draw(numbers), draw(numbers), draw(numbers))
    goal = (draw(numbers), draw(numbers))
    discs = [
        d
        for d in draw(st.lists(st.builds(Disc, numbers, numbers, sizes, sizes), max_size=4))
        if all(math.hypot(x - d.x, y - d.y) > d.radius for x, y in (start[:2], goal))
    ]
    bounds = (-1e6, -1e6, 1e6, 1e6)
    world = World(draw(names), bounds, tuple(discs), draw(st.none() | st.text(max_size=200)))
    if goal == start[:2]:
        goal = (goal[0] / 2 + 1, goal[1])
        if any(math.hypot(goal[0] - d.x, goal[1] - d.y) <= d.radius for d in discs):
            world = World(world.name, bounds)
    frame = draw(st.sampled_from([(0.0, 0.0, 0.0), (1.5, -2.0, 0.25)]))  # how the world lies in its map
    return Task(world, start, goal, draw(sizes), draw(st.floats(401.0, 1e6)), frame=frame)


@settings(max_examples=60)
@given(tasks())
def test_a_written_task_reads_back_exactly_and_survives_json(tmp_path_factory, task):
    path = tmp_path_factory.mktemp("w") / "task.yaml"
    save_task(task, path)
    assert load_task(path) == task
    assert task_from_dict(json.loads(json.dumps(task_to_dict(task)))) == task


def test_a_written_file_is_what_people_would_write(tmp_path):
    """Without a time limit, movers, or a frame, which it does not need."""
    save_task(TASK, tmp_path / "one.yaml")
    assert (
        (tmp_path / "one.yaml").read_text()
        == """\
schema: 1
name: one
source: made up
bounds: [0.0, 0.0, 10.0, 8.0]
start: [1.0, 1.0, 1.5707963267948966]
goal: [9.0, 7.0]
goal_tolerance: 0.3
cell: 0.25
obstacles:
  - {x: 5.0, y: 4.0, radius: 1.0, height: 1.0}
  - {x: 2.5, y: 6.125, radius: 0.5, height: 2.0}
"""
    )


def test_numpy_numbers_are_written_as_numbers(tmp_path):
    task = Task(World("n", (0, 0, 9, 9), (Disc(*np.array([5.0, 5.0, 1e-5])),)), (1, 1, 0), (8, 8))
    save_task(task, tmp_path / "n.yaml")
    assert load_task(tmp_path / "n.yaml") == task


def test_a_task_that_no_file_can_hold_is_not_written(tmp_path):
    with pytest.raises(ValueError, match="name"):
        save_task(Task(World("", (0, 0, 9, 9)), (1, 1, 0), (8, 8)), tmp_path / "w.yaml")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("count", "place", "problem"),
    [
        (36_000, 1 / 3, "not written: 36000 obstacles and 0 movers make 2."),
        (41_000, 2.0, "values; the limits are 2 MB and 200000 values; use fewer"),
    ],
)
def test_a_world_that_could_not_be_read_back_is_not_written(tmp_path, count, place, problem):
    discs = (Disc(5.0, 4.0 + place, 0.1),) * count
    with pytest.raises(InputError) as caught:
        save_task(
            Task(World("many", (0.0, 0.0, 10.0, 8.0), discs), (1.0, 1.0, 0.0), (9.0, 7.0)), tmp_path / "many.yaml"
        )
    assert str(caught.value).startswith(f"{tmp_path / 'many.yaml'}: not written: {count} obstacles")
    assert problem in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_the_largest_world_that_is_written_reads_back(tmp_path, monkeypatch):
    """Values are counted alike in writing and in reading."""
    from antdrive.base import document
    from antdrive.worlds.files import world_file

    values = document.count_values(task_to_dict(TASK))
    for limit, written in ((values - 1, False), (values, True)):
        for module in (document, world_file):
            monkeypatch.setattr(module, "MAX_VALUES", limit)
        if written:
            save_task(TASK, tmp_path / "one.yaml")
            assert load_task(tmp_path / "one.yaml").world == TASK.world
        else:
            with pytest.raises(InputError, match="not written"):
                save_task(TASK, tmp_path / "one.yaml")
    monkeypatch.setattr(document, "MAX_VALUES", values - 1)
    clear_caches()
    with pytest.raises(InputError):
        load_task(tmp_path / "one.yaml")


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    path = tmp_path / "w.yaml"
    path.write_text("the old one")

    def fail(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", fail)
    with pytest.raises((InputError, OSError)):
        save_task(TASK, path)
    assert [p.name for p in tmp_path.iterdir()] == ["w.yaml"]
    assert path.read_bytes() == b"the old one"


def test_an_unwritable_path_is_invalid_input(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        save_task(TASK, tmp_path / "file" / "w.yaml")
    with pytest.raises(InputError, match="cannot be written"):
        save_task(TASK, tmp_path)


@pytest.mark.skipif(os.name != "posix", reason="permissions are those of POSIX")
def test_a_written_file_may_be_read_like_any_other(tmp_path):
    save_task(TASK, tmp_path / "w.yaml")
    (tmp_path / "plain").write_text("")
    modes = [stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("w.yaml", "plain")]
    assert modes[0] == modes[1]


# Schema


def test_the_schema_lists_every_key_and_the_required_ones():
    schema = task_schema()
    json.dumps(schema)
    assert set(schema["properties"]) == {*task_to_dict(TASK), "movers", "time_limit", "tasks", "frame"}
    assert schema["required"] == ["schema", "bounds", "start", "goal"]
    assert schema["additionalProperties"] is False
    assert schema["properties"]["start"]["minItems"] == schema["properties"]["start"]["maxItems"] == 3
    assert schema["$defs"]["Disc"]["properties"]["radius"]["exclusiveMinimum"] == 0


# Tasks beside a world's own

NAMED = """\
schema: 1
bounds: [0, 0, 10, 6]
start: [1, 1, 0]
goal: [9, 1]
goal_tolerance: 0.3
tasks:
  - {name: dock, goal: [9, 5]}
  - {name: back, start: [9, 5, 3.1], goal: [1, 1], goal_tolerance: 0.1}
"""


def test_tasks_are_chosen_by_name(tmp_path):
    (tmp_path / "office.yaml").write_text(NAMED)
    own, dock, back = (load_task(tmp_path / "office.yaml", name) for name in (None, "dock", "back"))
    assert (own.start, own.goal) == ((1, 1, 0), (9, 1))
    assert (dock.start, dock.goal, dock.goal_tolerance) == ((1, 1, 0), (9, 5), 0.3)
    assert (back.start, back.goal, back.goal_tolerance) == ((9, 5, 3.1), (1, 1), 0.1)
    assert load_tasks(tmp_path / "office.yaml") == {"dock": dock, "back": back}
    assert load_tasks("empty") == {}
