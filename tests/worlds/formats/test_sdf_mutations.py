"""Mutated Gazebo worlds: each is a valid world or refused in one line."""

import copy
import random
import xml.etree.ElementTree as ET

import pytest

from antdrive.base import InputError
from antdrive.worlds import import_sdf
from tests.worlds.formats.test_sdf import cylinder, state, world
from tests.worlds.formats.test_sdf_includes import actor, include, model_in, post
from tests.worlds.formats.test_sdf_shapes import SHAPES, TENT, placed, stl

NUMBERS = (
    "nan", "inf", "-inf", "-1", "0", "1e300", "1e-300", "1e6", "999999", "1e5", "0x10", "", "one", "1 2", "1,2,3", "٣",
)  # fmt: skip
NAMES = (
    "post", "base", "l", "", "__model__", "world", "post::l", "../..", "a" * 300, "\x7f", "model://post", "file:///dev/zero",
)  # fmt: skip


def base(folder):
    model_in(folder / "models" / "post", post(include("model://inner")))
    model_in(folder / "models" / "inner")
    (folder / "tent.stl").write_text(stl(*TENT))
    shapes = [
        placed(text, (2 * i, 1, 0.5, 0.3, 0.2, i), f"s{i}")
        for i, text in enumerate(SHAPES[kind][0] for kind in ("box", "cone", "polyline"))
    ]
    parts = (
        cylinder("can", "5 5 0.5 0 0 0"), *shapes, placed("<mesh><uri>tent.stl</uri></mesh>", (0, 4, 0, 0, 0, 0)),
        include("model://post", "<name>there</name><pose relative_to='can'>1 2 0 0 0 0</pose>"),
        post("<pose relative_to='f'>1 1 0 0 0 0</pose>", "base"), "<frame name='f' attached_to='can'/>",
        actor((0, 3, 3), (2, 4, 3)), state("<model name='can'><pose>6 5 0.5 0 0 0</pose><scale>1 1 2</scale></model>"),
    )  # fmt: skip
    return world(folder, *parts).read_text()


def mutated(text, rng):
    """Return the text with one to three faults."""
    root = ET.fromstring(text)
    for _ in range(rng.randint(1, 3)):
        parents = {child: parent for parent in root.iter() for child in parent}
        if not parents:
            break
        element = rng.choice(list(parents))
        kind = rng.choice(["drop", "twice", "number", "number", "name", "name", "move", "rename", "empty"])
        if kind == "drop":
            parents[element].remove(element)
        elif kind == "twice":
            parents[element].append(copy.deepcopy(element))
        elif kind == "number":
            words = (element.text or "").split() or [""]
            words[rng.randrange(len(words))] = rng.choice(NUMBERS)
            element.text = " ".join(words)
        elif kind == "name":
            key = rng.choice(["name", "relative_to", "attached_to", "placement_frame", "merge", "degrees"])
            element.set(key, rng.choice([*NAMES, "true"]))
        elif kind == "move":
            rng.choice(list(root.iter())).append(copy.deepcopy(element))
        elif kind == "rename":
            element.tag = rng.choice(
                ["model", "include", "link", "pose", "mesh", "polyline", "actor", "world", "uri", "state"]
            )
        else:
            element.clear()
    made = ET.tostring(root, encoding="unicode")
    return made[: rng.randrange(len(made))] if rng.random() < 0.1 else made


@pytest.mark.parametrize("block", range(5))
def test_mutated_worlds_are_imported_or_refused_in_one_line(block, tmp_path):
    text, rng = base(tmp_path), random.Random(block)
    path, outcomes = tmp_path / "made.world", []
    said = []
    for _ in range(30):
        path.write_text(mutated(text, rng))
        try:
            made = import_sdf(path, skip_unsupported=rng.random() < 0.5, resolution=0.1)
            outcomes.append(len(made.world.obstacles) > 0)
        except InputError as error:
            said.append(str(error))
    assert len(outcomes) > 0
    assert len(said) > 0
    assert [text for text in said if not (text.isprintable() and text.startswith(str(tmp_path)))] == []
