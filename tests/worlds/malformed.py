"""World files that are wrong in one way each; `test_messages.yml` beside has what is said of each."""

from __future__ import annotations

_START = """\
schema: 1
name: bad
bounds: [0.0, 0.0, 10.0, 10.0]
start: [1.0, 1.0, 0.0]
goal: [9.0, 9.0]
goal_tolerance: 0.25
cell: 0.5
"""
_END = """\
obstacles:
  - {x: 5.0, y: 5.0, radius: 0.5}
"""
#: A file without a fault; each of the malformed ones differs from it in one way.
GOOD = _START + _END


def _replace(old: str, new: str) -> str:
    assert GOOD.count(old) == 1
    return GOOD.replace(old, new)


def _disc(disc: str) -> str:
    return f"{GOOD}  - {disc}\n"


def _mover(mover: str) -> str:
    return f"{GOOD}movers:\n  - {mover}\n"


def _bomb() -> str:
    """Nine levels of ten aliases each: a billion values in half a kilobyte."""
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 9)]
    return GOOD + "\n".join(lines) + "\n"


#: By name, what the file holds.
MALFORMED: dict[str, str | bytes] = {
    # not even YAML
    "empty": "",
    "only a comment": "# nothing here\n",
    "binary": b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR",
    "latin-1": GOOD.replace("name: bad", "name: größe").encode("latin-1"),
    "utf-16": GOOD.encode("utf-16"),
    "null character": GOOD + "# \x00\n",
    "tab": GOOD + "\tsource: me\n",
    "unclosed list": _replace("[9.0, 9.0]", "[9.0, 9.0"),
    "unclosed quote": _replace("name: bad", 'name: "bad'),
    "colon in text": _replace("name: bad", "name: bad: worse"),
    "two documents": GOOD + "---\nschema: 1\n",
    "unknown alias": GOOD + "source: *other\n",
    "deep nesting": GOOD + "source: " + "[" * 3000 + "]" * 3000,
    "merge conflict": GOOD + "<<<<<<< HEAD\n",
    # YAML, but no plain data
    "python object": GOOD + "source: !!python/name:os.system\n",
    "own tag": GOOD + "source: !mine [1]\n",
    "set": GOOD + "source: !!set {a, b}\n",
    "alias bomb": _bomb(),
    "alias to itself": GOOD + "movers: &m [*m]\n",
    "list as a key": GOOD + "? [a, b]\n: 1\n",
    "duplicate key": GOOD + "cell: 0.25\n",
    "duplicate key inside": _disc("{x: 1.0, y: 5.0, x: 2.0, radius: 0.5}"),
    # plain data, but no mapping
    "list": "- 1\n- 2\n",
    "text": "hello\n",
    "null": "null\n",
    # keys
    "unknown key": GOOD + "colour: red\n",
    "misspelt key": _replace("obstacles", "obstacels"),
    "key in capitals": _replace("goal: ", "Goal: "),
    "number as a key": GOOD + "1: 2\n",
    "merge key": GOOD + "<<: {cell: 1.0}\n",
    "misspelt key inside": _disc("{x: 1.0, y: 5.0, raduis: 0.5}"),
    "no schema": _replace("schema: 1\n", ""),
    "no start": _replace("start: [1.0, 1.0, 0.0]\n", ""),
    "no bounds": _replace("bounds: [0.0, 0.0, 10.0, 10.0]\n", ""),
    "no radius": _disc("{x: 1.0, y: 5.0}"),
    # kinds
    "newer schema": _replace("schema: 1", "schema: 2"),
    "schema as text": _replace("schema: 1", 'schema: "1"'),
    "schema as a float": _replace("schema: 1", "schema: 1.0"),
    "schema true": _replace("schema: 1", "schema: true"),
    "name is a number": _replace("name: bad", "name: 7"),
    "name is no": _replace("name: bad", "name: no"),
    "name is empty": _replace("name: bad", 'name: ""'),
    "name of two lines": _replace("name: bad", 'name: "a\\nb"'),
    "source is a list": GOOD + "source: [me]\n",
    "start is text": _replace("[1.0, 1.0, 0.0]", "here"),
    "start is a mapping": _replace("[1.0, 1.0, 0.0]", "{x: 1.0}"),
    "start without yaw": _replace("[1.0, 1.0, 0.0]", "[1.0, 1.0]"),
    "goal with yaw": _replace("[9.0, 9.0]", "[9.0, 9.0, 0.0]"),
    "three bounds": _replace("[0.0, 0.0, 10.0, 10.0]", "[0.0, 0.0, 10.0]"),
    "obstacles is a number": _replace(_END, "obstacles: 3\n"),
    "obstacles without a value": _replace(_END, "obstacles:\n"),
    "obstacle is a list": _disc("[5.0, 5.0, 0.5]"),
    # numbers
    "bool for a number": _replace("cell: 0.5", "cell: true"),
    "null for a number": _replace("cell: 0.5", "cell:"),
    "number in quotes": _replace("cell: 0.5", 'cell: "0.5"'),
    "unit": _replace("cell: 0.5", "cell: 50cm"),
    "comma for a point": _replace("cell: 0.5", "cell: 0,5"),
    "exponent without a point": _disc("{x: 1.0, y: 5.0, radius: 1e-3}"),
    "exponent without a sign": _replace("cell: 0.5", "cell: 5.0e1"),
    "octal": _replace("[9.0, 9.0]", "[010, 9.0]"),
    "hexadecimal": _replace("[9.0, 9.0]", "[0x8, 9.0]"),
    "sixties": _replace("[9.0, 9.0]", "[9.0, 1:30]"),
    "nan": _disc("{x: .nan, y: 5.0, radius: 0.5}"),
    "infinite": _replace("10.0, 10.0]", "10.0, .inf]"),
    "minus infinite": _replace("[1.0, 1.0, 0.0]", "[1.0, -.inf, 0.0]"),
    "too large for a float": _replace("cell: 0.5", "cell: 1.0e+999"),
    "a thousand digits": _replace("cell: 0.5", "cell: " + "9" * 1000),
    "five thousand digits": _replace("cell: 0.5", "cell: " + "9" * 5000),
    "far away": _disc("{x: 1.0e+300, y: 5.0, radius: 0.5}"),
    "huge": _disc("{x: 1.0, y: 5.0, radius: 1.0e+9}"),
    "negative radius": _disc("{x: 1.0, y: 5.0, radius: -1}"),
    "no height": _disc("{x: 1.0, y: 5.0, radius: 0.5, height: 0}"),
    "no tolerance": _replace("tolerance: 0.25", "tolerance: 0.0"),
    "negative cell": _replace("cell: 0.5", "cell: -0.5"),
    "tiny cell": _replace("cell: 0.5", "cell: 0.00001"),
    # a world that cannot be
    "bounds reversed": _replace("[0.0, 0.0, 10.0, 10.0]", "[10.0, 0.0, 0.0, 10.0]"),
    "bounds without a size": _replace("[0.0, 0.0, 10.0, 10.0]", "[0.0, 5.0, 10.0, 5.0]"),
    "start in an obstacle": _disc("{x: 1.2, y: 1.0, radius: 0.5}"),
    "goal in an obstacle": _disc("{x: 9, y: 9, radius: 1}"),
    "start out of bounds": _replace("[1.0, 1.0, 0.0]", "[-1.0, 1.0, 0.0]"),
    "goal out of bounds": _replace("[9.0, 9.0]", "[9.0, 19.0]"),
    "goal is the start": _replace("[9.0, 9.0]", "[1.0, 1.0]"),
    # movers
    "movers without a value": GOOD + "movers:\n",
    "movers is a mapping": GOOD + "movers: {radius: 0.3}\n",
    "mover is a number": _mover("0.3"),
    "mover without a motion": _mover("{radius: 0.3}"),
    "mover without a radius": _mover("{velocity: [1, 0], position: [5, 2]}"),
    "mover with a negative radius": _mover("{radius: -1, velocity: [1, 0], position: [5, 2]}"),
    "mover with two motions": _mover("{radius: 0.3, keyframes: [[0, 5, 1], [8, 5, 9]], velocity: [1, 0]}"),
    "misspelt key of a mover": _mover("{radius: 0.3, keyframe: [[0, 5, 1], [8, 5, 9]]}"),
    "mover without places": _mover("{radius: 0.3, keyframes: []}"),
    "mover with one place": _mover("{radius: 0.3, keyframes: [[0, 5, 1]]}"),
    "keyframe without a time": _mover("{radius: 0.3, keyframes: [[0, 5, 1], [5, 9]]}"),
    "keyframe is a number": _mover("{radius: 0.3, keyframes: [[0, 5, 1], 8]}"),
    "keyframe of text": _mover("{radius: 0.3, keyframes: [[0, 5, 1], [8, 5, up]]}"),
    "keyframe that is not finite": _mover("{radius: 0.3, keyframes: [[0, 5, 1], [.inf, 5, 9]]}"),
    "keyframes at one time": _mover("{radius: 0.3, keyframes: [[0, 5, 1], [3, 5, 9], [3, 5, 8]]}"),
    "keyframes back in time": _mover("{radius: 0.3, keyframes: [[8, 5, 1], [0, 5, 9]]}"),
    "keyframes too fast": _mover("{radius: 0.3, keyframes: [[0, 5, 1], [0.1, 5, 9]]}"),
    "unknown loop": _mover("{radius: 0.3, loop: pong, keyframes: [[0, 5, 1], [8, 5, 9]]}"),
    "unknown interpolation": _mover("{radius: 0.3, interpolation: cubic, keyframes: [[0, 5, 1], [8, 5, 9]]}"),
    "loop without keyframes": _mover("{radius: 0.3, loop: once, velocity: [1, 0], position: [5, 2]}"),
    "negative phase": _mover("{radius: 0.3, phase: -2, keyframes: [[0, 5, 1], [8, 5, 9]]}"),
    "velocity without a position": _mover("{radius: 0.3, velocity: [1, 0]}"),
    "velocity of nothing": _mover("{radius: 0.3, velocity: [0, 0], position: [5, 2]}"),
    "velocity with three entries": _mover("{radius: 0.3, velocity: [1, 0, 0], position: [5, 2]}"),
    "mover beyond the walls": _mover("{radius: 0.3, velocity: [1, 0], position: [9.9, 2]}"),
    "mover wider than the world": _mover("{radius: 6, velocity: [1, 0], position: [5, 5]}"),
    "walk without a period": _mover("{radius: 0.2, walk: {cell: 0.5}}"),
    "walk is a number": _mover("{radius: 0.2, walk: 3}"),
    "walk with a seed that is not whole": _mover("{radius: 0.2, walk: {cell: 0.5, period: 1, seed: 1.5}}"),
    "walk with a misspelt key": _mover("{radius: 0.2, walk: {cell: 0.5, periode: 1}}"),
    "walk in no time": _mover("{radius: 0.2, walk: {cell: 0.5, period: 0.001}}"),
    "walk too fast": _mover("{radius: 0.2, walk: {cell: 2, period: 0.1}}"),
    "walk on too many cells": _mover("{radius: 0.2, walk: {cell: 0.00001, period: 1}}"),
    "walk from an obstacle": _mover("{radius: 0.2, walk: {cell: 0.5, period: 1, start: [5, 5]}}"),
    "walk from out of bounds": _mover("{radius: 0.2, walk: {cell: 0.5, period: 1, start: [15, 5]}}"),
    "walk without room": _mover("{radius: 4.9, walk: {cell: 0.5, period: 1}}"),
    "start in a mover": _mover("{radius: 0.5, keyframes: [[0, 1.2, 1], [8, 5, 9]]}"),
    "time limit of nothing": GOOD + "time_limit: 0\n",
}
