"""World files that are wrong in one way each, with the error message that each must cause.

The file is called bad.yaml.
"""

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


#: name -> (what the file holds, what the error says after the file's name)
MALFORMED: dict[str, tuple[str | bytes, str]] = {
    # not even YAML
    "empty": ("", "bad.yaml: is empty"),
    "only a comment": ("# nothing here\n", "bad.yaml: is empty"),
    "binary": (b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR", "bad.yaml:1: is not a text file in UTF-8"),
    "latin-1": (GOOD.replace("name: bad", "name: größe").encode("latin-1"), "bad.yaml:2: is not a text file"),
    "utf-16": (GOOD.encode("utf-16"), "bad.yaml:1: is not a text file"),
    "null character": (GOOD + "# \x00\n", "bad.yaml:10: not YAML: a special character '\\x00'"),
    "tab": (GOOD + "\tsource: me\n", "bad.yaml:10: not YAML: a tab; indent with spaces"),
    "unclosed list": (_replace("[9.0, 9.0]", "[9.0, 9.0"), "bad.yaml:6: not YAML: "),
    "unclosed quote": (_replace("name: bad", 'name: "bad'), "bad.yaml:10: not YAML: "),
    "colon in text": (_replace("name: bad", "name: bad: worse"), "bad.yaml:2: not YAML: mapping values"),
    "two documents": (GOOD + "---\nschema: 1\n", "bad.yaml:10: not YAML: but found another document"),
    "unknown alias": (GOOD + "source: *other\n", "bad.yaml:10: not YAML: found undefined alias"),
    "deep nesting": (
        GOOD + "source: " + "[" * 3000 + "]" * 3000,
        "bad.yaml:10: not YAML: nested deeper than",
    ),
    "merge conflict": (GOOD + "<<<<<<< HEAD\n", "bad.yaml:11: not YAML: "),
    # YAML, but no plain data
    "python object": (GOOD + "source: !!python/name:os.system\n", "bad.yaml:10: source: must be plain data"),
    "own tag": (GOOD + "source: !mine [1]\n", "bad.yaml:10: source: must be plain data, got the tag !mine"),
    "set": (GOOD + "source: !!set {a, b}\n", "bad.yaml:10: source: must be plain data, got the tag !!set"),
    "alias bomb": (_bomb(), "its aliases stand for too much; write the values out"),
    "alias to itself": (GOOD + "movers: &m [*m]\n", "bad.yaml:10: movers: its aliases stand for too much"),
    "list as a key": (GOOD + "? [a, b]\n: 1\n", "bad.yaml:10: a key must be a word"),
    "duplicate key": (GOOD + "cell: 0.25\n", "bad.yaml:10: cell: is given twice, first on line 7"),
    "duplicate key inside": (
        _disc("{x: 1.0, y: 5.0, x: 2.0, radius: 0.5}"),
        "bad.yaml:10: obstacles[1].x: is given twice",
    ),
    # plain data, but no mapping
    "list": ("- 1\n- 2\n", "bad.yaml: must be a mapping with the keys schema, name, bounds, start, goal"),
    "text": (
        "hello\n",
        'bad.yaml: must be a mapping with the keys schema, name, bounds, start, goal, got "hello"',
    ),
    "null": ("null\n", "bad.yaml: must be a mapping"),
    # keys
    "unknown key": (GOOD + "colour: red\n", "bad.yaml:10: colour: unknown key; choose from schema, name"),
    "misspelt key": (
        _replace("obstacles", "obstacels"),
        "bad.yaml:8: obstacels: unknown key; did you mean obstacles?",
    ),
    "key in capitals": (_replace("goal: ", "Goal: "), "bad.yaml:5: Goal: unknown key; did you mean goal?"),
    "number as a key": (GOOD + "1: 2\n", "bad.yaml:10: 1: unknown key"),
    "merge key": (GOOD + "<<: {cell: 1.0}\n", "bad.yaml:10: <<: unknown key"),
    "misspelt key inside": (
        _disc("{x: 1.0, y: 5.0, raduis: 0.5}"),
        "bad.yaml:10: obstacles[1].raduis: unknown key; did you mean radius?",
    ),
    "no schema": (_replace("schema: 1\n", ""), "bad.yaml: schema: missing; write schema: 1"),
    "no start": (_replace("start: [1.0, 1.0, 0.0]\n", ""), "bad.yaml: start: missing; write [x, y, yaw]"),
    "no bounds": (
        _replace("bounds: [0.0, 0.0, 10.0, 10.0]\n", ""),
        "bad.yaml: bounds: missing; write [xmin, ymin",
    ),
    "no radius": (
        _disc("{x: 1.0, y: 5.0}"),
        "bad.yaml:10: obstacles[1].radius: missing; the radius as built, never inflated [m]",
    ),
    # kinds
    "newer schema": (_replace("schema: 1", "schema: 2"), "bad.yaml:1: schema: must be 1, got 2"),
    "schema as text": (_replace("schema: 1", 'schema: "1"'), 'bad.yaml:1: schema: must be 1, got "1"'),
    "schema as a float": (_replace("schema: 1", "schema: 1.0"), "bad.yaml:1: schema: must be 1, got 1.0"),
    "schema true": (_replace("schema: 1", "schema: true"), "bad.yaml:1: schema: must be 1, got true"),
    "name is a number": (_replace("name: bad", "name: 7"), "bad.yaml:2: name: must be text, got 7"),
    "name is no": (_replace("name: bad", "name: no"), "bad.yaml:2: name: must be text, got false"),
    "name is empty": (_replace("name: bad", 'name: ""'), "bad.yaml:2: name: "),
    "name of two lines": (_replace("name: bad", 'name: "a\\nb"'), "bad.yaml:2: name: must be one line"),
    "source is a list": (GOOD + "source: [me]\n", 'bad.yaml:10: source: must be text, got ["me"]'),
    "start is text": (_replace("[1.0, 1.0, 0.0]", "here"), 'bad.yaml:4: start: must be a list, got "here"'),
    "start is a mapping": (
        _replace("[1.0, 1.0, 0.0]", "{x: 1.0}"),
        "bad.yaml:4: start: must be a list, got a mapping",
    ),
    "start without yaw": (
        _replace("[1.0, 1.0, 0.0]", "[1.0, 1.0]"),
        "bad.yaml:4: start: must have 3 entries, got 2; write [x, y, yaw]",
    ),
    "goal with yaw": (
        _replace("[9.0, 9.0]", "[9.0, 9.0, 0.0]"),
        "bad.yaml:5: goal: must have 2 entries, got 3",
    ),
    "three bounds": (
        _replace("[0.0, 0.0, 10.0, 10.0]", "[0.0, 0.0, 10.0]"),
        "bad.yaml:3: bounds: must have 4 entries",
    ),
    "obstacles is a number": (
        _replace(_END, "obstacles: 3\n"),
        "bad.yaml:8: obstacles: must be a list, got 3",
    ),
    "obstacles without a value": (
        _replace(_END, "obstacles:\n"),
        "bad.yaml:8: obstacles: must be a list, got null",
    ),
    "obstacle is a list": (
        _disc("[5.0, 5.0, 0.5]"),
        "bad.yaml:10: obstacles[1]: must be a mapping with the keys x, y, radius, got [5.0, 5.0, 0.5]",
    ),
    # numbers
    "bool for a number": (
        _replace("cell: 0.5", "cell: true"),
        "bad.yaml:7: cell: must be a number, got true",
    ),
    "null for a number": (_replace("cell: 0.5", "cell:"), "bad.yaml:7: cell: must be a number, got null"),
    "number in quotes": (
        _replace("cell: 0.5", 'cell: "0.5"'),
        'bad.yaml:7: cell: must be a number, got "0.5" (text)',
    ),
    "unit": (_replace("cell: 0.5", "cell: 50cm"), 'bad.yaml:7: cell: must be a number, got "50cm"'),
    "comma for a point": (_replace("cell: 0.5", "cell: 0,5"), "bad.yaml:7: cell: must be a"),
    "exponent without a point": (
        _disc("{x: 1.0, y: 5.0, radius: 1e-3}"),
        'bad.yaml:10: obstacles[1].radius: must be a number, got "1e-3" (text); write 1.0e-3',
    ),
    "exponent without a sign": (
        _replace("cell: 0.5", "cell: 5.0e1"),
        "bad.yaml:7: cell: must be a number, got ",
    ),
    "octal": (
        _replace("[9.0, 9.0]", "[010, 9.0]"),
        "bad.yaml:5: goal[0]: must be a plain decimal number, got 010",
    ),
    "hexadecimal": (
        _replace("[9.0, 9.0]", "[0x8, 9.0]"),
        "bad.yaml:5: goal[0]: must be a plain decimal number",
    ),
    "sixties": (
        _replace("[9.0, 9.0]", "[9.0, 1:30]"),
        "bad.yaml:5: goal[1]: must be a plain decimal number, got 1:30",
    ),
    "nan": (
        _disc("{x: .nan, y: 5.0, radius: 0.5}"),
        "bad.yaml:10: obstacles[1].x: must be a finite number, got .nan",
    ),
    "infinite": (
        _replace("10.0, 10.0]", "10.0, .inf]"),
        "bad.yaml:3: bounds[3]: must be a finite number, got .inf",
    ),
    "minus infinite": (
        _replace("[1.0, 1.0, 0.0]", "[1.0, -.inf, 0.0]"),
        "bad.yaml:4: start[1]: must be a finite number",
    ),
    "too large for a float": (
        _replace("cell: 0.5", "cell: 1.0e+999"),
        "bad.yaml:7: cell: must be a finite number",
    ),
    "a thousand digits": (
        _replace("cell: 0.5", "cell: " + "9" * 1000),
        "bad.yaml:7: cell: must be a finite number",
    ),
    "five thousand digits": (
        _replace("cell: 0.5", "cell: " + "9" * 5000),
        "bad.yaml:7: cell: must be a finite",
    ),
    "far away": (
        _disc("{x: 1.0e+300, y: 5.0, radius: 0.5}"),
        "bad.yaml:10: obstacles[1].x: must be at most 1e+06",
    ),
    "huge": (
        _disc("{x: 1.0, y: 5.0, radius: 1.0e+9}"),
        "bad.yaml:10: obstacles[1].radius: must be at most 1e+06",
    ),
    "negative radius": (
        _disc("{x: 1.0, y: 5.0, radius: -1}"),
        "bad.yaml:10: obstacles[1].radius: must be greater than 0, got -1",
    ),
    "no height": (
        _disc("{x: 1.0, y: 5.0, radius: 0.5, height: 0}"),
        "bad.yaml:10: obstacles[1].height: must be greater",
    ),
    "no tolerance": (
        _replace("tolerance: 0.25", "tolerance: 0.0"),
        "bad.yaml:6: goal_tolerance: must be greater than 0",
    ),
    "negative cell": (
        _replace("cell: 0.5", "cell: -0.5"),
        "bad.yaml:7: cell: must be greater than 0, got -0.5",
    ),
    "tiny cell": (
        _replace("cell: 0.5", "cell: 0.00001"),
        "bad.yaml:7: cell: 1e-05 m cuts these bounds into more than",
    ),
    # a world that cannot be
    "bounds reversed": (
        _replace("[0.0, 0.0, 10.0, 10.0]", "[10.0, 0.0, 0.0, 10.0]"),
        "bad.yaml:3: bounds: must be [xmin, ymin, xmax, ymax] with min < max",
    ),
    "bounds without a size": (
        _replace("[0.0, 0.0, 10.0, 10.0]", "[0.0, 5.0, 10.0, 5.0]"),
        "bad.yaml:3: bounds: must be",
    ),
    "start in an obstacle": (
        _disc("{x: 1.2, y: 1.0, radius: 0.5}"),
        "bad.yaml:4: start: (1, 1) is inside obstacles[1] at (1.2, 1) with radius 0.5",
    ),
    "goal in an obstacle": (
        _disc("{x: 9, y: 9, radius: 1}"),
        "bad.yaml:5: goal: (9, 9) is inside obstacles[1]",
    ),
    "start out of bounds": (
        _replace("[1.0, 1.0, 0.0]", "[-1.0, 1.0, 0.0]"),
        "bad.yaml:4: start: (-1, 1) is out of bounds",
    ),
    "goal out of bounds": (
        _replace("[9.0, 9.0]", "[9.0, 19.0]"),
        "bad.yaml:5: goal: (9, 19) is out of bounds",
    ),
    "goal is the start": (
        _replace("[9.0, 9.0]", "[1.0, 1.0]"),
        "bad.yaml:5: goal: is where the robot starts",
    ),
    # movers
    "movers without a value": (GOOD + "movers:\n", "bad.yaml:10: movers: must be a list, got null"),
    "movers is a mapping": (GOOD + "movers: {radius: 0.3}\n", "bad.yaml:10: movers: must be a list, got a mapping"),
    "mover is a number": (_mover("0.3"), "bad.yaml:11: movers[0]: must be a mapping with the keys radius, got 0.3"),
    "mover without a motion": (
        _mover("{radius: 0.3}"),
        "bad.yaml:11: movers[0]: must have one of the keys keyframes, velocity, walk",
    ),
    "mover without a radius": (
        _mover("{velocity: [1, 0], position: [5, 2]}"),
        "bad.yaml:11: movers[0].radius: missing; the radius as built [m]",
    ),
    "mover with a negative radius": (
        _mover("{radius: -1, velocity: [1, 0], position: [5, 2]}"),
        "bad.yaml:11: movers[0].radius: must be greater than 0, got -1",
    ),
    "mover with two motions": (
        _mover("{radius: 0.3, keyframes: [[0, 5, 1], [8, 5, 9]], velocity: [1, 0]}"),
        "bad.yaml:11: movers[0].velocity: cannot be given together with keyframes; a mover moves in one way",
    ),
    "misspelt key of a mover": (
        _mover("{radius: 0.3, keyframe: [[0, 5, 1], [8, 5, 9]]}"),
        "bad.yaml:11: movers[0].keyframe: unknown key; did you mean keyframes?",
    ),
    "mover without places": (
        _mover("{radius: 0.3, keyframes: []}"),
        "bad.yaml:11: movers[0].keyframes: must have at least 2 entries [t, x, y], got 0",
    ),
    "mover with one place": (
        _mover("{radius: 0.3, keyframes: [[0, 5, 1]]}"),
        "bad.yaml:11: movers[0].keyframes: must have at least 2 entries",
    ),
    "keyframe without a time": (
        _mover("{radius: 0.3, keyframes: [[0, 5, 1], [5, 9]]}"),
        "bad.yaml:11: movers[0].keyframes[1]: must have 3 entries, got 2; write [t, x, y]",
    ),
    "keyframe is a number": (
        _mover("{radius: 0.3, keyframes: [[0, 5, 1], 8]}"),
        "bad.yaml:11: movers[0].keyframes[1]: must be a list, got 8",
    ),
    "keyframe of text": (
        _mover("{radius: 0.3, keyframes: [[0, 5, 1], [8, 5, up]]}"),
        'bad.yaml:11: movers[0].keyframes[1][2]: must be a number, got "up"',
    ),
    "keyframe that is not finite": (
        _mover("{radius: 0.3, keyframes: [[0, 5, 1], [.inf, 5, 9]]}"),
        "bad.yaml:11: movers[0].keyframes[1][0]: must be a finite number",
    ),
    "keyframes at one time": (
        _mover("{radius: 0.3, keyframes: [[0, 5, 1], [3, 5, 9], [3, 5, 8]]}"),
        "bad.yaml:11: movers[0].keyframes[2]: its time must be later than the 3 s before it, got 3",
    ),
    "keyframes back in time": (
        _mover("{radius: 0.3, keyframes: [[8, 5, 1], [0, 5, 9]]}"),
        "bad.yaml:11: movers[0].keyframes[1]: its time must be later than the 8 s",
    ),
    "keyframes too fast": (
        _mover("{radius: 0.3, keyframes: [[0, 5, 1], [0.1, 5, 9]]}"),
        "bad.yaml:11: movers[0].keyframes[1]: is reached at 80 m/s; at most 20 m/s are allowed",
    ),
    "unknown loop": (
        _mover("{radius: 0.3, loop: pong, keyframes: [[0, 5, 1], [8, 5, 9]]}"),
        "bad.yaml:11: movers[0].loop: must be 'pingpong', 'teleport' or 'once', got \"pong\"",
    ),
    "unknown interpolation": (
        _mover("{radius: 0.3, interpolation: cubic, keyframes: [[0, 5, 1], [8, 5, 9]]}"),
        "bad.yaml:11: movers[0].interpolation: must be 'linear' or 'catmull-rom'",
    ),
    "loop without keyframes": (
        _mover("{radius: 0.3, loop: once, velocity: [1, 0], position: [5, 2]}"),
        "bad.yaml:11: movers[0].loop: belongs to keyframes, not to velocity; remove it",
    ),
    "negative phase": (
        _mover("{radius: 0.3, phase: -2, keyframes: [[0, 5, 1], [8, 5, 9]]}"),
        "bad.yaml:11: movers[0].phase: must be at least 0, got -2",
    ),
    "velocity without a position": (
        _mover("{radius: 0.3, velocity: [1, 0]}"),
        "bad.yaml:11: movers[0].position: missing; write [x, y], the centre at first",
    ),
    "velocity of nothing": (
        _mover("{radius: 0.3, velocity: [0, 0], position: [5, 2]}"),
        "bad.yaml:11: movers[0].velocity: must be a speed above 0 and at most 20 m/s, got 0",
    ),
    "velocity with three entries": (
        _mover("{radius: 0.3, velocity: [1, 0, 0], position: [5, 2]}"),
        "bad.yaml:11: movers[0].velocity: must have 2 entries, got 3; write [vx, vy]",
    ),
    "mover beyond the walls": (
        _mover("{radius: 0.3, velocity: [1, 0], position: [9.9, 2]}"),
        "bad.yaml:11: movers[0].position: (9.9, 2) leaves no room for radius 0.3 within bounds",
    ),
    "mover wider than the world": (
        _mover("{radius: 6, velocity: [1, 0], position: [5, 5]}"),
        "bad.yaml:11: movers[0].position: (5, 5) leaves no room",
    ),
    "walk without a period": (
        _mover("{radius: 0.2, walk: {cell: 0.5}}"),
        "bad.yaml:11: movers[0].walk.period: missing; time for one step [s]",
    ),
    "walk is a number": (
        _mover("{radius: 0.2, walk: 3}"),
        "bad.yaml:11: movers[0].walk: must be a mapping with the keys cell, period, got 3",
    ),
    "walk with a seed that is not whole": (
        _mover("{radius: 0.2, walk: {cell: 0.5, period: 1, seed: 1.5}}"),
        "bad.yaml:11: movers[0].walk.seed: must be a whole number, got 1.5",
    ),
    "walk with a misspelt key": (
        _mover("{radius: 0.2, walk: {cell: 0.5, periode: 1}}"),
        "bad.yaml:11: movers[0].walk.periode: unknown key; did you mean period?",
    ),
    "walk in no time": (
        _mover("{radius: 0.2, walk: {cell: 0.5, period: 0.001}}"),
        "bad.yaml:11: movers[0].walk.period: must be at least 0.05, got 0.001",
    ),
    "walk too fast": (
        _mover("{radius: 0.2, walk: {cell: 2, period: 0.1}}"),
        "bad.yaml:11: movers[0].walk.period: a diagonal in 0.1 s is faster than 20 m/s",
    ),
    "walk on too many cells": (
        _mover("{radius: 0.2, walk: {cell: 0.00001, period: 1}}"),
        "bad.yaml:11: movers[0].walk.cell: 1e-05 m cuts this world into more than",
    ),
    "walk from an obstacle": (
        _mover("{radius: 0.2, walk: {cell: 0.5, period: 1, start: [5, 5]}}"),
        "bad.yaml:11: movers[0].walk.start: radius 0.2 has no room in the cell around (5.25, 5.25)",
    ),
    "walk from out of bounds": (
        _mover("{radius: 0.2, walk: {cell: 0.5, period: 1, start: [15, 5]}}"),
        "bad.yaml:11: movers[0].walk.start: (15, 5) is out of bounds",
    ),
    "walk without room": (
        _mover("{radius: 4.9, walk: {cell: 0.5, period: 1}}"),
        "bad.yaml:11: movers[0].walk: found no free cell of 0.5 m to begin in, 1 m from the robot's start",
    ),
    "start in a mover": (
        _mover("{radius: 0.5, keyframes: [[0, 1.2, 1], [8, 5, 9]]}"),
        "bad.yaml:4: start: (1, 1) is inside movers[0], which begins at (1.2, 1) with radius 0.5",
    ),
    "time limit of nothing": (GOOD + "time_limit: 0\n", "bad.yaml:10: time_limit: must be greater than 0, got 0"),
}
