"""What a test demands of a drive: its outcome, bounds on metrics, and how much worse than the baseline it may be."""

from __future__ import annotations

import dataclasses
import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Literal

from antdrive.base.checks import show, suggest
from antdrive.base.errors import FieldError
from antdrive.sim.log.metrics import METRICS, WALL_CLOCK, Tolerance
from antdrive.sim.log.outcome import Outcome

#: The distance between the places where two drives end, which is judged like a metric [m].
END = "end_m"
END_TOLERANCE = Tolerance(0.05)
LEAST_TRAJECTORY = 0.002  # baselines hold positions in whole millimetres [m]

#: The kinds of things that a robot can touch.
CYLINDER, UNSEEN, MOVER, WALL = "cylinder", "unseen cylinder", "mover", "wall"
KINDS = (CYLINDER, UNSEEN, MOVER, WALL)

#: The keys of `expect` that are no metrics.
NON_METRICS = ("outcome", "certified", "touched", "cause")

_SIGNS: Mapping[str, Callable[[float, float], bool]] = MappingProxyType(
    {">=": operator.ge, "<=": operator.le, ">": operator.gt, "<": operator.lt, "==": operator.eq}
)
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_BOUND = re.compile(rf"\s*(>=|<=|>|<|==)\s*({_NUMBER})\s*")
_SHARE = re.compile(rf"\s*({_NUMBER})\s*%\s*")


@dataclass(frozen=True)
class Bound:
    """A bound on a metric, such as min_clearance_m >= 0.05.

    Attributes:
        metric: a name of `METRICS`
        sign: one of >=, <=, >, < and ==
        value: in the metric's unit
    """

    metric: str
    sign: str
    value: float

    def holds(self, found: float) -> bool:
        """Whether a value keeps the bound; no number never does.

        Args:
            found: the metric of a drive
        """
        return not math.isnan(found) and _SIGNS[self.sign](found, self.value)

    def broken(self, found: float) -> Bound | None:
        """The bound that values keep which break this one as a value does; None where the value keeps it, or is no number.

        Args:
            found: the metric of a drive
        """
        if self.holds(found) or math.isnan(found):
            return None
        signs = {">=": "<", "<=": ">", ">": "<=", "<": ">=", "==": ">" if found > self.value else "<"}
        return dataclasses.replace(self, sign=signs[self.sign])

    def __str__(self) -> str:
        return f"{self.metric} {self.sign} {self.value:g}"


@dataclass(frozen=True, kw_only=True)
class Demands:
    """What a test demands of a drive.

    Attributes:
        outcome: how the run must end
        certified: whether the drive must be certified collision-free; None: it must be if it is to succeed
        touched: what kind of thing must be touched first, one of `KINDS`; None: any, or none
        cause: what must have taken most of the margin by then, one of `causes`; None: anything
        bounds: bounds on metrics
        tolerances: how much worse than the baseline each metric may be, where it is not the metric's own tolerance; None:
            the metric is not compared
        trajectory: how far from the baseline's line the robot may be at any time [m]; "exact": the drive must be the
            same, bit for bit; None: the line is not judged
    """

    outcome: Outcome = Outcome.SUCCEEDED
    certified: bool | None = None
    touched: str | None = None
    cause: str | None = None
    bounds: tuple[Bound, ...] = ()
    tolerances: Mapping[str, Tolerance | None] = field(default_factory=dict)
    trajectory: float | Literal["exact"] | None = None

    @property
    def must_be_certified(self) -> bool:
        """Whether the drive must be certified collision-free."""
        return self.outcome is Outcome.SUCCEEDED if self.certified is None else self.certified

    def tolerance(self, name: str) -> Tolerance | None:
        """How much worse than the baseline a metric may be; None where it is not compared.

        Args:
            name: the name of a metric, or `END`
        """
        if name in self.tolerances:
            return self.tolerances[name]
        return END_TOLERANCE if name == END else METRICS[name].tolerance

    @classmethod
    def of(
        cls,
        expect: Mapping[str, Any] = MappingProxyType({}),
        tolerance: Mapping[str, Any] = MappingProxyType({}),
        trajectory: float | str | None = None,
    ) -> Demands:
        """Demands as people write them.

        >>> Demands.of({"min_clearance_m": ">= 0.05"}, {"duration_s": "10 %", "jerk_rms": "any"}, 0.05)

        Args:
            expect: outcome, certified, what is touched and why, and bounds on metrics such as ">= 5, <= 30"
            tolerance: by metric, or `end_m`: a number in its unit, a share such as "10 %", or "any"
            trajectory: a distance [m], or "exact"

        Raises:
            FieldError: an unknown metric or outcome, or a value of another form.
        """
        bounds: list[Bound] = []
        for key, value in expect.items():
            if key not in NON_METRICS:
                bounds += _bounds(key, value)
        outcome = _outcome(expect.get("outcome", Outcome.SUCCEEDED.key))
        return cls(
            outcome=outcome,
            certified=_certified(expect.get("certified")),
            touched=_of_a_contact("touched", expect, lambda: KINDS, outcome),
            cause=_of_a_contact("cause", expect, causes, outcome),
            bounds=tuple(bounds),
            tolerances={key: _tolerance(key, value) for key, value in tolerance.items()},
            trajectory=_trajectory(trajectory),
        )


def _outcome(value: Any) -> Outcome:
    keys = [outcome.key for outcome in Outcome]
    if value not in keys:
        hint = suggest(str(value), keys)
        raise FieldError("expect.outcome", f"unknown outcome {show(value)}; {hint}")
    return Outcome.from_key(value)


def _certified(value: Any) -> bool | None:
    if value is not None and not isinstance(value, bool):
        raise FieldError("expect.certified", f"must be true or false, got {show(value)}")
    return value


def causes() -> Sequence[str]:
    """What can take the margin. Where they are listed loads the compiler, which collecting tests does not need."""
    from antdrive.sim.log.margin import CAUSES

    return tuple(CAUSES)


def _of_a_contact(
    key: str, expect: Mapping[str, Any], choices: Callable[[], Sequence[str]], outcome: Outcome
) -> str | None:
    """What is demanded of a contact, which must be what the test expects."""
    value = expect.get(key)
    if value is None:
        return None
    known = choices()
    if value not in known:
        raise FieldError(f"expect.{key}", f"unknown {show(value)}; choose from {', '.join(known)}")
    if not outcome.with_contact:
        raise FieldError(f"expect.{key}", f"nothing is touched where the outcome is {outcome.key}; leave it out")
    return str(value)


def _bounds(key: str, value: Any) -> list[Bound]:
    if key not in METRICS:
        known = [*NON_METRICS, *METRICS]
        raise FieldError(f"expect.{key}", f"no such metric; {suggest(key, known)}")
    if key in WALL_CLOCK:
        raise FieldError(f"expect.{key}", "depends on the machine and its load, so no test can bound it; leave it out")
    if isinstance(value, int | float) and not isinstance(value, bool):
        if METRICS[key].unit == "1" and float(value).is_integer():  # such as contacts_driving: 0
            return [Bound(key, "==", float(value))]
        sign = "<=" if METRICS[key].better == "lower" else ">="
        raise FieldError(f"expect.{key}", f'no drive has exactly this; write a bound such as "{sign} {value:g}"')
    found = []
    for part in str(value).split(",") if isinstance(value, str) else [""]:
        match = _BOUND.fullmatch(part)
        if not match:
            raise FieldError(f"expect.{key}", f'must be a bound such as ">= 0.05" or ">= 5, <= 30", got {show(value)}')
        found.append(Bound(key, match[1], float(match[2])))
    return found


def _tolerance(key: str, value: Any) -> Tolerance | None:
    where = f"tolerance.{key}"
    if key not in METRICS and key != END:
        raise FieldError(where, f"no such metric; {suggest(key, [*METRICS, END])}")
    if key != END and METRICS[key].better == "neither" and value != "any":
        raise FieldError(where, "neither more nor less of it is better, so it is not compared; bound it in expect")
    if value == "any":
        return None
    share = _SHARE.fullmatch(value) if isinstance(value, str) else None
    if share and key == END:
        raise FieldError(where, f"must be a distance in metres, because there is no length to share, got {show(value)}")
    if share and float(share[1]) >= 0:
        return Tolerance(relative=float(share[1]) / 100)
    if isinstance(value, int | float) and not isinstance(value, bool) and 0 <= value < math.inf:
        return Tolerance(float(value))
    unit = "m" if key == END else METRICS[key].unit
    raise FieldError(
        where, f'must be a number of at least 0 [{unit}], a share such as "10 %", or any, got {show(value)}'
    )


def _trajectory(value: Any) -> float | Literal["exact"] | None:
    if value is None or value == "exact":
        return value  # type: ignore[no-any-return]
    if isinstance(value, int | float) and not isinstance(value, bool) and LEAST_TRAJECTORY <= value < math.inf:
        return float(value)
    raise FieldError(
        "trajectory", f"must be exact, or a distance of at least {LEAST_TRAJECTORY:g} m, got {show(value)}"
    )
