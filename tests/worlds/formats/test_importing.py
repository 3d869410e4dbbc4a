"""`import_file` chooses the format and refuses options of other formats."""

import json

import pytest

from antdrive.base import FieldError
from antdrive.worlds import export_map_server, export_movingai_map, export_sdf, import_file, import_format, load_task
from tests.worlds.formats.test_dynabarn import ONE

GIVEN = {
    "start": (1.0, 1.0, 0.0), "goal": (2.0, 1.0), "bounds": (0.0, 0.0, 9.0, 9.0), "cell": 0.5, "skip_unsupported": True,
    "unknown": "free", "overhang": 0.1, "resolution": 0.5, "problem": 0,
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "about"),
    [
        ("w.sdf", "an SDF world"),
        ("W.WORLD", "an SDF world"),
        ("w.yaml", "a map_server map"),
        ("w.yml", "a map_server map"),
        ("w.map", "a MovingAI map"),
        ("w.json", "a DynaBARN set"),
    ],
)
def test_the_suffix_says_which_format_a_file_has(name, about):
    assert import_format(name).name == about


def test_a_barn_world_is_an_sdf_world_with_ends_of_its_own():
    assert import_format("w.world", barn=True).name == "a BARN world"


@pytest.mark.parametrize("name", ["w.sdf", "w.yaml", "w.map", "w.json"])
def test_options_of_other_formats_are_refused_before_the_file_is_read(name):
    takes = import_format(name).options
    for key, value in GIVEN.items():
        if key not in takes:
            with pytest.raises(FieldError) as caught:
                import_file(name, **{key: value})
            assert caught.value.key == key
            assert import_format(name).name in caught.value.problem


def test_none_counts_as_not_given(tmp_path):
    (tmp_path / "set.json").write_text(json.dumps([ONE, ONE | {"name": "two"}]))
    tasks = import_file(tmp_path / "set.json", **dict.fromkeys(GIVEN))
    assert [task.world.name for task in tasks] == ["one", "two"]


def test_every_format_gives_its_tasks(tmp_path):
    task = load_task("slalom")
    export_sdf(task, tmp_path / "w.sdf")
    assert import_file(tmp_path / "w.sdf") == [task]
    export_map_server(task, tmp_path / "w.yaml", resolution=0.1)
    export_movingai_map(task, tmp_path / "w.map", resolution=0.1)
    (served,) = import_file(tmp_path / "w.yaml", unknown="free")
    (octile,) = import_file(tmp_path / "w.map", start=task.start, goal=task.goal, resolution=0.1)
    assert (served.start, served.goal) == (octile.start, octile.goal) == (task.start, task.goal)
