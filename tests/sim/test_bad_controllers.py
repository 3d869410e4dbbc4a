"""Bad controllers of every kind: each is named in one line with its place, and the next drive is the same as ever."""

import itertools
import textwrap

import numpy as np
import pytest

from antdrive.base import FieldError, InputError
from antdrive.robots import ControllerError
from antdrive.sim import Scenario, run
from antdrive.sim.pipeline import Session, plan
from antdrive.worlds import Cruising, Disc, Task, World

MOVER = Cruising(radius=0.2, position=(5.0, 3.5), velocity=(-0.1, 0.0))
ROOM = World("room", (0.0, 0.0, 6.0, 4.0), (Disc(2.0, 3.2, 0.2),), movers=(MOVER,))
TASK = Task(ROOM, (1.0, 2.0, 0.4), (2.0, 2.0))

#: A controller whose parts each case replaces.
FOLLOWER = """
import asyncio, gc, os, random, signal, sys, threading, time, warnings
from dataclasses import dataclass

import numpy as np

from antdrive import InputError
from antdrive.robots import ControllerCapabilities, Twist

class Halting(BaseException): pass

class Unprintable(Exception):
    def __str__(self): raise GeneratorExit
    __repr__ = __str__
    __class__ = property(__str__)

class Odd(tuple):
    def __len__(self): return 2
    def __getitem__(self, at): raise LookupError("nothing here")
    def __iter__(self): raise LookupError("no parts")
    __repr__ = __iter__

class Number:
    def __init__(self, error): self.error = error
    def __float__(self): raise self.error

def deeper(): return deeper()

def forever():
    while True: pass

def raising(error): raise error

@dataclass(frozen=True, kw_only=True)
class Good:
    gain: float = 1.0

    def start(self, briefing, path): return 0.0

    def step(self, now, path, arc):
        arc = path.nearest(now.pose, arc)
        return Twist(0.5 * path.speed_limit(arc), 0.1), arc
"""
#: What code raises, by the beginning of what is said of it.
RAISED = {
    "raising(ValueError('lost'))": "raised ValueError: lost",
    "raising(ValueError('a\\nb\\x1b[31m'))": r"raised ValueError: a\nb\x1b[31m",
    "raising(ValueError('x' * 100_000))": "raised ValueError: xxx",
    "raising(Exception())": "raised Exception",
    "raising(Exception)": "raised Exception",
    "raising(Halting('mine'))": "raised Halting: mine",
    "raising(Unprintable('no text'))": "raised Unprintable",
    "raising(7)": "raised TypeError: exceptions must derive",
    "raising(StopIteration(3))": "raised StopIteration: 3",
    "raising(GeneratorExit())": "raised GeneratorExit",
    "raising(KeyboardInterrupt())": "raised KeyboardInterrupt",
    "raising(asyncio.CancelledError())": "raised CancelledError",
    "raising(MemoryError())": "raised MemoryError",
    "raising(OSError(28, 'full'))": "raised OSError: [Errno 28] full",
    "raising(BrokenPipeError())": "raised BrokenPipeError",
    "raising(UserWarning('odd'))": "raised UserWarning: odd",
    "sys.exit()": "raised SystemExit",
    "sys.exit('bye')": "raised SystemExit: bye",
    "bytearray(1 << 60)": "raised MemoryError",
    "deeper()": "raised RecursionError: maximum",
    "1 / 0": "raised ZeroDivisionError",
    "[][1]": "raised IndexError",
    "{}['a']": "raised KeyError: 'a'",
    "None.pose": "raised AttributeError",
    "unknown": "raised NameError",
    "open('absent')": "raised FileNotFoundError",
    "__import__('absent_module')": "raised ModuleNotFoundError",
    "exec('1 +')": "raised SyntaxError",
    "np.linalg.inv(np.zeros((2, 2)))": "raised LinAlgError",
    "next(iter(()))": "raised StopIteration",
}
PLACES = {
    "start": "def start(self, briefing, path): return {}",
    "first step": "def step(self, now, path, arc): return {}",
    "later step": "def step(self, now, path, arc): return {} if now.tick > 5 else super().step(now, path, arc)",
    "capabilities": "capabilities = property(lambda self: {})",
}
#: What `step` returns, by the beginning of what is said of it.
ANSWERS = {
    "None": "returned None instead of (Twist, state)",
    "()": "returned () instead of (Twist, state)",
    "1.0": "returned 1.0 instead",
    "'ab'": "returned 'ab' instead",
    "(1.0, 0.0, arc)": "returned (1.0, 0.0, 0.0) instead",
    "[Twist(1.0, 0.0), arc]": "returned [Twist(speed=1.0, yaw_rate=0.0), 0.0] instead",
    "{'twist': 1}": "returned {'twist': 1} instead",
    "(x for x in (1, 2))": "returned <generator object",
    "lambda: 1": "returned <function",
    "np.zeros(2)": "returned array([0., 0.]) instead of (Twist, state)",
    "Odd()": "raised LookupError: nothing here",
    "Twist": "returned <class",
    "Twist(1.0, 0.0)": "returned 1.0 instead of a Twist of two finite numbers",
    "(None, arc)": "returned None instead of a Twist",
    "((), arc)": "returned () instead of a Twist",
    "((1.0,), arc)": "returned (1.0,) instead",
    "((1.0, 2.0, 3.0), arc)": "returned (1.0, 2.0, 3.0) instead",
    "('ab', arc)": "returned 'ab' instead",
    "(np.zeros((2, 2)), arc)": "returned array(",
    "(Odd(), arc)": "raised LookupError: no parts",
    "(('a', 'b'), arc)": "returned ('a', 'b') instead of a Twist",
    "(('1.0', '0.0'), arc)": "returned ('1.0', '0.0') instead of a Twist",
    "((b'1', 0.0), arc)": "returned (b'1', 0.0)",
    "((None, 0.0), arc)": "returned (None, 0.0)",
    "(Twist(float('nan'), 0.0), arc)": "returned Twist(speed=nan, yaw_rate=0.0)",
    "(Twist(0.0, float('nan')), arc)": "returned Twist(speed=0.0, yaw_rate=nan)",
    "(Twist(float('inf'), 0.0), arc)": "returned Twist(speed=inf",
    "(Twist(0.0, -float('inf')), arc)": "returned Twist(speed=0.0, yaw_rate=-inf)",
    "(Twist(np.nan, np.nan), arc)": "returned Twist(speed=nan",
    "(Twist(np.float32('inf'), 0), arc)": "returned Twist(speed=",
    "(Twist(10**400, 0.0), arc)": "returned Twist(speed=1000",
    "(Twist(1j, 0.0), arc)": "returned Twist(speed=1j",
    "(Twist([1.0], 0.0), arc)": "returned Twist(speed=[1.0]",
    "(Twist(np.zeros(2), 0.0), arc)": "returned Twist(speed=array(",
    "(Twist(Number(ValueError()), 0.0), arc)": "returned Twist(speed=<",
    "(Twist(Number(KeyError('k')), 0.0), arc)": "raised KeyError: 'k'",
    "(Twist(np.datetime64('2020'), 0.0), arc)": "returned Twist(speed=",
    "(Twist(Twist(1.0, 0.0), 0.0), arc)": "returned Twist(speed=Twist(",
}
#: Other methods, by the beginning of what is said of them.
METHODS = {
    "def step(self, now, path, arc): now.pose[0] = 1.0": "raised TypeError: 'tuple' object does not support",
    "def step(self, now, path, arc): now.tick = 1": "raised AttributeError",
    "def step(self, now, path, arc): path.backwards = True": "raised FrozenInstanceError",
    "def step(self, now, path, arc): self.gain = 2.0": "raised FrozenInstanceError",
    "def step(self, now, path, arc): path.route.xy[:] = 0.0": "raised ValueError: assignment destination is read-only",
    "def step(self, now, path, arc): return super().step(now, path, None)": "raised Typ",
    "def step(self, now, path, arc): return super().step(now, path, 'a')": "raised Typ",
    "def start(self, briefing, path): briefing.goal = (0, 0)": "raised FrozenInstanceError",
    "def start(self, briefing, path): briefing.robot.radius = 0": "raised FrozenInstanceError",
    "def start(self, briefing, path): return path.speed_limit('a')": "raised TypeError",
    **{
        f"capabilities = {one}": f"declares {one} instead of ControllerCapabilities"
        for one in ("None", "7", "{}", "'turns'")
    },
    "capabilities = ControllerCapabilities": "declares <class",
}
#: Classes and options that no controller has, by what is said of them.
CLASSES = {
    "class Bad: pass": "it has no methods start(briefing, path) and step(now, path, state)",
    "class Bad:\n    def step(self, now, path, state): pass": "it has no methods start",
    "class Bad:\n    def start(self, briefing, path): pass": "it has no methods start",
    "class Bad(Good): step = 3": "it has no methods start",
    "class Bad(Good): start = None": "it has no methods start",
    "class Bad(Good):\n    def step(self, now): pass": "its method must be step(now, path, state)",
    "class Bad(Good):\n    def step(): pass": "its method must be step(now, path, state) (invalid method signature)",
    "class Bad(Good):\n    def start(self): pass": "its method must be start(briefing, path)",
    "class Bad(Good):\n    def start(self, briefing, path, more): pass": "its method must be start(briefing, path)",
    "class Bad(Good):\n    def step(self, now, path, state, *, more): pass": "its method must be step",
    "class Bad(Good):\n    def __init__(self, gain): pass": "give all its options default values",
    "@dataclass(frozen=True)\nclass Bad:\n    gain: float": "give all its options default values",
    "class Bad(Good):\n    step = property(lambda self: 1 / 0)": "cannot be loaded: ZeroDivisionError",
    "class Bad(Good):\n    def __getattribute__(self, name): raise KeyError(name)": "cannot be loaded: KeyError",
    "class Meta(type):\n    def __call__(self): 1 / 0\nclass Bad(Good, metaclass=Meta): pass": "ZeroDivisionError",
    "class Bad(Good):\n    async def step(self, now, path, arc): pass": "it is asynchronous, or yields",
    "class Bad(Good):\n    def step(self, now, path, arc): yield": "it is asynchronous, or yields",
    "class Bad(Good):\n    async def start(self, briefing, path): yield": "it is asynchronous, or yields",
    "@dataclass\nclass Bad(Good): pass": "Bad needs @dataclass(frozen=True)",
    "def Bad(): pass": "it has no methods start",
    "Bad = 3": "it has no methods start",
    "Bad = None": "it has no methods start",
    "Bad = Good(gain=float('nan'), more=1)": "unexpected keyword argument",
    "import os as Bad": "it has no methods start",
    "class Bed(Good): pass": "did you mean Bed?",
    "class Bad(": "SyntaxError",
    "raise ValueError('on import')": "ValueError: on import",
    "sys.exit(3)": "calls exit on import (exit code 3",
    "from absent import Bad": "ModuleNotFoundError",
    "forever()": "took longer than the limit of 0.3 s on import",
}
OPTIONS = [("gain", one) for one in ("fast", "", "nan", "inf", "1e999", "1,2", None, True, [1.0], {}, 1j, float("nan"))]
OPTIONS += [(one, 1.0) for one in ("gian", "", "a b", "name_", "__class__", "gain ")]
#: What code does to the process, to what it is given and to itself: allowed, or an error of the controller.
DEEDS = {
    "arrays of the path": "[one.fill(0.5) for one in path.samples if np.ndim(one) and one.flags.writeable]",
    "arrays of the kernel": "[one.fill(0.5) for one in path.packed if one.flags.writeable]",
    "obstacles": "path.obstacles.discs.fill(1.2)",
    "index of obstacles": "path.obstacles.starts.fill(0)",
    "fields of the path": "object.__setattr__(path, 'limits', path.limits._replace(speed=99.0))",
    "movers": "[one.fill(0) for one in now.movers]",
    "global random numbers": "(np.random.seed(tick), random.seed(tick), np.random.rand())",
    "printing": "(print('noise'), print('noise', file=sys.stderr))",
    "closed streams": "(sys.stdout.close(), sys.stderr.close())",
    "folder": "os.chdir('/')",
    "variables": "os.environ.clear()",
    "warnings as errors": "(warnings.simplefilter('error'), np.seterr(all='raise'))",
    "a warning": "warnings.warn('odd', stacklevel=1)",
    "handlers": "(signal.signal(signal.SIGINT, signal.SIG_IGN), signal.signal(signal.SIGTERM, signal.SIG_IGN))",
    "an alarm": "signal.setitimer(signal.ITIMER_REAL, 0.001)",
    "threads": "threading.Thread(target=time.sleep, args=(0.01,)).start()",
    "a thread that raises": "threading.Thread(target=lambda: None).start()",
    "no garbage collection": "gc.disable()",
    "depth": "sys.setrecursionlimit(500)",
    "a lower umask": "os.umask(0o777)",
    "import path": "sys.path.clear()",
}
ACTIONS = [
    "ab",
    b"ab",
    1.0,
    (),
    (1.0,),
    (1.0, 2.0, 3.0),
    ("1", "2"),
    (None, 0.0),
    (0.0, 1j),
    {},
    {0.1, 0.2},
    [[1.0, 0.0]],
]
ACTIONS += [(one, 0.0) for one in (float("nan"), float("inf"), -float("inf"), 10**400, np.nan, "0.1", [1.0], object())]
ACTIONS += [(0.0, float("nan")), np.zeros(3), np.zeros((2, 2)), np.full(2, np.nan), object, lambda: 1]
STATES = [
    "lambda: 1",
    "(x for x in ())",
    "threading.Lock()",
    "[[]] * 9",
    "np.zeros(9)",
    "float('nan')",
    "None",
]


def written(case, text):
    """A class of its own for a case, in the body of `Good`."""
    return f"\nclass Bad{case}(Good):\n{textwrap.indent(text, '    ')}\n"


FAULTS = [(place.format(code), says) for (code, says), place in itertools.product(RAISED.items(), PLACES.values())]
FAULTS += [(PLACES["first step"].format(code), says) for code, says in ANSWERS.items()]
FAULTS += METHODS.items()
ALLOWED = [
    f"def step(self, now, path, arc):\n    tick = now.tick\n    {deed}\n    return super().step(now, path, arc)"
    for deed in DEEDS.values()
]
ALLOWED += [f"def step(self, now, path, arc): return super().step(now, path, 0.0)[0], {state}" for state in STATES]


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("bad") / "bad.py"
    cases = [text for text, _ in FAULTS] + ALLOWED
    path.write_text(FOLLOWER + "".join(written(case, text) for case, text in enumerate(cases)))
    return path


@pytest.fixture(scope="module")
def planned():
    return plan(Scenario.of(TASK, "astar"))


@pytest.fixture(scope="module")
def driven(file, planned):
    """Drives with a controller of the file."""

    def drive(name, **options):
        controller = {"name": f"{file}:{name}", **options}
        return run(Scenario.of(TASK, "astar", controller=controller, time_limit=0.5), planned=planned)

    return drive


@pytest.fixture(scope="module")
def before(driven):
    """Digests of good drives before the bad ones."""
    return good(driven)


def said_by(error, make, *words, **options):
    """What an error says, in one line; nothing without one."""
    try:
        make(*words, **options)
    except error as raised:
        said = str(raised)
        return said if "\n" not in said and len(said) < 600 else f"too much: {said}"
    return "nothing"


def good(driven):
    """Digests of good drives: by a controller of one's own, and by one that uses all of the path."""
    built_in = Scenario.of(TASK, "astar", controller="dwa", time_limit=0.5)
    return driven("Good").rollout.digest, run(built_in).rollout.digest


def test_every_fault_is_named_in_one_line_with_its_place_and_changes_no_later_drive(driven, before):
    wrong = []
    for case, (text, says) in enumerate(FAULTS):
        said = said_by(ControllerError, driven, f"Bad{case}")
        named = said.startswith(f"controller Bad{case} {says}") and ("bad.py:" in said or "declares" in said)
        wrong += [] if named else [(text, says, said)]
    assert not wrong
    assert good(driven) == before


@pytest.mark.parametrize(("case", "text"), [*enumerate(ALLOWED, len(FAULTS))], ids=[*DEEDS, *STATES])
def test_no_controller_changes_what_others_see_or_the_next_drive(case, text, driven, before):
    said_by(ControllerError, driven, f"Bad{case}")
    assert good(driven) == before


@pytest.mark.parametrize("text", CLASSES)
def test_a_class_that_is_no_controller_is_invalid_input(text, tmp_path, monkeypatch):
    monkeypatch.setenv("ANTDRIVE_PLAN_LIMIT", "0.3")
    (tmp_path / "bad.py").write_text(f"{FOLLOWER}\n{text}\n")
    said = said_by((InputError, ControllerError), Scenario.of, TASK, "astar", controller=f"{tmp_path}/bad.py:Bad")
    assert said.startswith("controller")
    assert CLASSES[text] in said


@pytest.mark.parametrize(("name", "value"), OPTIONS)
def test_a_bad_option_of_a_controller_is_invalid_input(name, value, driven):
    said = said_by(InputError, driven, "Good", **{name: value})
    assert said.startswith(f"controller.{name}: ")


@pytest.mark.parametrize("action", ACTIONS, ids=[str(i) for i in range(len(ACTIONS))])
def test_a_bad_action_is_named_and_loses_nothing(action, planned):
    s = Scenario.of(TASK, "astar", time_limit=0.5)
    with Session(s, planned) as drive:
        drive.step((0.1, 0.0))
        assert said_by(FieldError, drive.step, action).startswith("command: must be two finite numbers")
        while not drive.ended:
            drive.step((0.1, 0.0))
    with Session(s, planned) as good:
        while not good.ended:
            good.step((0.1, 0.0))
    assert drive.run.rollout.drive_digest == good.run.rollout.drive_digest
