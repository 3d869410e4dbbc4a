"""World files with one error each; the snapshot of `test_messages.py` has the messages."""

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


def _replace(old, new):
    assert GOOD.count(old) == 1
    return GOOD.replace(old, new)


def _bomb():
    """Nine levels of ten aliases each: a billion values in half a kilobyte."""
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 9)]
    return GOOD + "\n".join(lines) + "\n"


#: What stands in the place of something that is right, by the name of the fault.
REPLACED = {
    "unclosed list": ("[9.0, 9.0]", "[9.0, 9.0"), "unclosed quote": ("name: bad", 'name: "bad'),
    "colon in text": ("name: bad", "name: bad: worse"), "misspelt key": ("obstacles", "obstacels"),
    "key in capitals": ("goal: ", "Goal: "), "no schema": ("schema: 1\n", ""),
    "no start": ("start: [1.0, 1.0, 0.0]\n", ""), "no bounds": ("bounds: [0.0, 0.0, 10.0, 10.0]\n", ""),
    "newer schema": ("schema: 1", "schema: 2"), "schema as text": ("schema: 1", 'schema: "1"'),
    "schema as a float": ("schema: 1", "schema: 1.0"), "schema true": ("schema: 1", "schema: true"),
    "name is a number": ("name: bad", "name: 7"), "name is no": ("name: bad", "name: no"),
    "name is empty": ("name: bad", 'name: ""'), "name of two lines": ("name: bad", 'name: "a\\nb"'),
    "start is text": ("[1.0, 1.0, 0.0]", "here"), "start is a mapping": ("[1.0, 1.0, 0.0]", "{x: 1.0}"),
    "start without yaw": ("[1.0, 1.0, 0.0]", "[1.0, 1.0]"), "goal with yaw": ("[9.0, 9.0]", "[9.0, 9.0, 0.0]"),
    "three bounds": ("[0.0, 0.0, 10.0, 10.0]", "[0.0, 0.0, 10.0]"), "obstacles is a number": (_END, "obstacles: 3\n"),
    "obstacles without a value": (_END, "obstacles:\n"), "bool for a number": ("cell: 0.5", "cell: true"),
    "null for a number": ("cell: 0.5", "cell:"), "number in quotes": ("cell: 0.5", 'cell: "0.5"'),
    "unit": ("cell: 0.5", "cell: 50cm"), "comma for a point": ("cell: 0.5", "cell: 0,5"),
    "exponent without a sign": ("cell: 0.5", "cell: 5.0e1"), "octal": ("[9.0, 9.0]", "[010, 9.0]"),
    "hexadecimal": ("[9.0, 9.0]", "[0x8, 9.0]"), "sixties": ("[9.0, 9.0]", "[9.0, 1:30]"),
    "infinite": ("10.0, 10.0]", "10.0, .inf]"), "minus infinite": ("[1.0, 1.0, 0.0]", "[1.0, -.inf, 0.0]"),
    "too large for a float": ("cell: 0.5", "cell: 1.0e+999"), "a thousand digits": ("cell: 0.5", "cell: " + "9" * 1000),
    "five thousand digits": ("cell: 0.5", "cell: " + "9" * 5000), "no tolerance": ("tolerance: 0.25", "tolerance: 0.0"),
    "negative cell": ("cell: 0.5", "cell: -0.5"), "tiny cell": ("cell: 0.5", "cell: 0.00001"),
    "bounds reversed": ("[0.0, 0.0, 10.0, 10.0]", "[10.0, 0.0, 0.0, 10.0]"),
    "bounds without a size": ("[0.0, 0.0, 10.0, 10.0]", "[0.0, 5.0, 10.0, 5.0]"),
    "start out of bounds": ("[1.0, 1.0, 0.0]", "[-1.0, 1.0, 0.0]"), "goal out of bounds": ("[9.0, 9.0]", "[9.0, 19.0]"),
    "goal is the start": ("[9.0, 9.0]", "[1.0, 1.0]"),
}  # fmt: skip
#: What stands at the end.
ADDED = {
    "null character": "# \x00\n", "tab": "\tsource: me\n", "two documents": "---\nschema: 1\n",
    "unknown alias": "source: *other\n", "merge conflict": "<<<<<<< HEAD\n",
    "python object": "source: !!python/name:os.system\n", "own tag": "source: !mine [1]\n",
    "set": "source: !!set {a, b}\n", "alias to itself": "movers: &m [*m]\n", "list as a key": "? [a, b]\n: 1\n",
    "duplicate key": "cell: 0.25\n", "unknown key": "colour: red\n", "number as a key": "1: 2\n",
    "merge key": "<<: {cell: 1.0}\n", "source is a list": "source: [me]\n", "movers without a value": "movers:\n",
    "movers is a mapping": "movers: {radius: 0.3}\n", "time limit of nothing": "time_limit: 0\n",
}  # fmt: skip
#: Another obstacle.
DISCS = {
    "duplicate key inside": "{x: 1.0, y: 5.0, x: 2.0, radius: 0.5}",
    "misspelt key inside": "{x: 1.0, y: 5.0, raduis: 0.5}", "no radius": "{x: 1.0, y: 5.0}",
    "obstacle is a list": "[5.0, 5.0, 0.5]", "exponent without a point": "{x: 1.0, y: 5.0, radius: 1e-3}",
    "nan": "{x: .nan, y: 5.0, radius: 0.5}", "far away": "{x: 1.0e+300, y: 5.0, radius: 0.5}",
    "huge": "{x: 1.0, y: 5.0, radius: 1.0e+9}", "negative radius": "{x: 1.0, y: 5.0, radius: -1}",
    "no height": "{x: 1.0, y: 5.0, radius: 0.5, height: 0}", "start in an obstacle": "{x: 1.2, y: 1.0, radius: 0.5}",
    "goal in an obstacle": "{x: 9, y: 9, radius: 1}",
}  # fmt: skip
#: A mover.
MOVERS = {
    "mover is a number": "0.3", "mover without a motion": "{radius: 0.3}",
    "mover without a radius": "{velocity: [1, 0], position: [5, 2]}",
    "mover with a negative radius": "{radius: -1, velocity: [1, 0], position: [5, 2]}",
    "mover with two motions": "{radius: 0.3, keyframes: [[0, 5, 1], [8, 5, 9]], velocity: [1, 0]}",
    "misspelt key of a mover": "{radius: 0.3, keyframe: [[0, 5, 1], [8, 5, 9]]}",
    "mover without places": "{radius: 0.3, keyframes: []}",
    "mover with one place": "{radius: 0.3, keyframes: [[0, 5, 1]]}",
    "keyframe without a time": "{radius: 0.3, keyframes: [[0, 5, 1], [5, 9]]}",
    "keyframe is a number": "{radius: 0.3, keyframes: [[0, 5, 1], 8]}",
    "keyframe of text": "{radius: 0.3, keyframes: [[0, 5, 1], [8, 5, up]]}",
    "keyframe that is not finite": "{radius: 0.3, keyframes: [[0, 5, 1], [.inf, 5, 9]]}",
    "keyframes at one time": "{radius: 0.3, keyframes: [[0, 5, 1], [3, 5, 9], [3, 5, 8]]}",
    "keyframes back in time": "{radius: 0.3, keyframes: [[8, 5, 1], [0, 5, 9]]}",
    "keyframes too fast": "{radius: 0.3, keyframes: [[0, 5, 1], [0.1, 5, 9]]}",
    "unknown loop": "{radius: 0.3, loop: pong, keyframes: [[0, 5, 1], [8, 5, 9]]}",
    "unknown interpolation": "{radius: 0.3, interpolation: cubic, keyframes: [[0, 5, 1], [8, 5, 9]]}",
    "loop without keyframes": "{radius: 0.3, loop: once, velocity: [1, 0], position: [5, 2]}",
    "negative phase": "{radius: 0.3, phase: -2, keyframes: [[0, 5, 1], [8, 5, 9]]}",
    "velocity without a position": "{radius: 0.3, velocity: [1, 0]}",
    "velocity of nothing": "{radius: 0.3, velocity: [0, 0], position: [5, 2]}",
    "velocity with three entries": "{radius: 0.3, velocity: [1, 0, 0], position: [5, 2]}",
    "mover beyond the walls": "{radius: 0.3, velocity: [1, 0], position: [9.9, 2]}",
    "mover wider than the world": "{radius: 6, velocity: [1, 0], position: [5, 5]}",
    "walk without a period": "{radius: 0.2, walk: {cell: 0.5}}", "walk is a number": "{radius: 0.2, walk: 3}",
    "walk with a seed that is not whole": "{radius: 0.2, walk: {cell: 0.5, period: 1, seed: 1.5}}",
    "walk with a misspelt key": "{radius: 0.2, walk: {cell: 0.5, periode: 1}}",
    "walk in no time": "{radius: 0.2, walk: {cell: 0.5, period: 0.001}}",
    "walk too fast": "{radius: 0.2, walk: {cell: 2, period: 0.1}}",
    "walk on too many cells": "{radius: 0.2, walk: {cell: 0.00001, period: 1}}",
    "walk from an obstacle": "{radius: 0.2, walk: {cell: 0.5, period: 1, start: [5, 5]}}",
    "walk from out of bounds": "{radius: 0.2, walk: {cell: 0.5, period: 1, start: [15, 5]}}",
    "walk without room": "{radius: 4.9, walk: {cell: 0.5, period: 1}}",
    "start in a mover": "{radius: 0.5, keyframes: [[0, 1.2, 1], [8, 5, 9]]}",
}  # fmt: skip
#: By name, what the file holds.
MALFORMED = {
    "empty": "", "only a comment": "# nothing here\n", "binary": b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR",
    "latin-1": GOOD.replace("name: bad", "name: größe").encode("latin-1"), "utf-16": GOOD.encode("utf-16"),
    "deep nesting": GOOD + "source: " + "[" * 3000 + "]" * 3000, "alias bomb": _bomb(), "list": "- 1\n- 2\n",
    "text": "hello\n", "null": "null\n",
    **{name: _replace(*change) for name, change in REPLACED.items()}, **{name: GOOD + text for name, text in ADDED.items()},
    **{name: f"{GOOD}  - {disc}\n" for name, disc in DISCS.items()},
    **{name: f"{GOOD}movers:\n  - {mover}\n" for name, mover in MOVERS.items()},
}  # fmt: skip
