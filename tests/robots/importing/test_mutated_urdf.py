"""Mutated URDF files: each is refused in one line, or gives a robot that its own reader reads."""

import random
import re

import pytest

from antdrive.base import InputError
from antdrive.robots.importing.urdf_import import import_urdf
from antdrive.robots.robot_file import robot_from_text
from tests.robots.importing.urdf_parts import LIMIT, box, joint, pair, robot, wheel

PLUGIN = (
    "<gazebo><plugin><leftJoint>front_left_wheel_joint</leftJoint><rightJoint>front_right_wheel_joint</rightJoint>"
    "<wheelDiameter>0.2</wheelDiameter></plugin></gazebo>"
)
SENSOR = (
    '<gazebo reference="scan"><sensor name="s" type="ray"><pose>0 0 0 0 0 0</pose><ray><scan><horizontal><samples>90</samples>'
    "<min_angle>-1</min_angle><max_angle>1</max_angle></horizontal></scan><range><min>0.1</min><max>9</max></range></ray></sensor></gazebo>"
)
WHOLE = robot(
    box("base"),
    pair(0.2, "front_"),
    pair(-0.2, "rear_").replace("</joint>", LIMIT.format("") + "</joint>"),
    '<link name="scan"/>',
    joint("scan_joint", "scan", "0 0 0.4", "fixed"),
    wheel("ball", 0.1, 0, 0.05, shape="sphere"),
    PLUGIN,
    SENSOR,
)
NUMBERS = ("nan", "inf", "-inf", "1e300", "-1", "0", "1e-320", "", "1 2", "0x10", "١", "1e16", "${x}")
CUTS = ("continuous", "revolute", "prismatic", "floating", "weird", "")


def mutated(seed):
    """Return the whole file with one to three faults."""
    rng, text = random.Random(seed), WHOLE
    for _ in range(rng.randint(1, 3)):
        kind = rng.randrange(9)
        words = list(re.finditer(r' \w+="[^"]*"', text))
        word = rng.choice(words) if words else re.match("", text)
        numbers = list(re.finditer(r'(?<=[" >])-?\d[\d.e-]*(?=[" <])', text))
        number = rng.choice(numbers) if numbers else re.match("", text)
        names = re.findall(r'name="([^"]*)"', text) or ["a"]
        tags = list(re.finditer(r"</?(\w+)", text))
        tag = rng.choice(tags) if tags else re.match("()", text)
        joints = list(re.finditer(r"<joint.*?</joint>", text)) or [re.match("", text)]
        text = (
            text[: word.start()] + text[word.end() :],  # an attribute less
            text[: number.start()] + rng.choice(NUMBERS) + text[number.end() :],
            text.replace(f"{tag[1]} ", f"{rng.choice(('box', 'lnk', 'mesh', 'joint'))} ", 1),  # a wrong tag
            text[: rng.randrange(max(len(text), 1))],  # truncated
            text.replace(f'link="{rng.choice(names)}"', f'link="{rng.choice(names)}"', 1),  # loops and strangers
            text.replace(f'name="{rng.choice(names)}"', f'name="{rng.choice(names)}"', 1),  # the same name twice
            text.replace('<box size="0.6 0.4 0.2"/>', '<mesh filename="package://a/gone.stl"/>', 1),
            text.replace('type="continuous"', f'type="{rng.choice(CUTS)}"', rng.randint(1, 5)),
            text.replace(rng.choice(joints)[0], "", 1),
        )[kind]
    return text


@pytest.mark.parametrize(
    "seeds", [range(first, first + 50) for first in (0, 50, 100)], ids=lambda seeds: f"{seeds[0]}-{seeds[-1]}"
)
def test_a_faulty_file_is_refused_in_one_line_or_gives_a_robot(tmp_path, seeds):
    for seed in seeds:
        path = tmp_path / "faulty.urdf"
        path.write_text(mutated(seed), encoding="utf-8")
        refused, found = "", None
        try:
            found = import_urdf(path)
        except InputError as error:
            refused = str(error)
        assert refused.isprintable(), (seed, refused)
        assert found is None or robot_from_text(found.text, "a", "a") == found.spec, seed


def test_the_file_before_its_faults_is_imported(tmp_path):
    path = tmp_path / "whole.urdf"
    path.write_text(WHOLE)
    assert import_urdf(path).spec.track == pytest.approx(0.44)
