"""Demands of a test on a drive: its outcome, bounds on metrics, and tolerances relative to the baseline."""

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

#: The distance between the ends of two drives, compared like a metric [m].
END = "end_m"
END_TOLERANCE = Tolerance(0.05)
LEAST_TRAJECTORY = 0.002  # least allowed distance: baselines hold positions in whole millimetres [m]

#: Kinds of things that a robot can touch.
CYLINDER, UNSEEN, MOVER, WALL = "cylinder", "unseen cylinder", "mover", "wall"
KINDS = (CYLINDER, UNSEEN, MOVER, WALL)

#: Keys of `expect` that are not metrics.
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

    def holds(self, measured: float) -> bool:
        """Return whether a value keeps the bound; NaN never does.

        Args:
            measured: the metric of a drive
        """
        return not math.isnan(measured) and _SIGNS[self.sign](measured, self.value)

    def broken(self, measured: float) -> Bound | None:
        """Return the opposite bound, which the value meets; None if the value keeps this bound or is NaN.

        Args:
            measured: the metric of a drive
        """
        if self.holds(measured) or math.isnan(measured):
            return None
        signs = {">=": "<", "<=": ">", ">": "<=", "<": ">=", "==": ">" if measured > self.value else "<"}
        return dataclasses.replace(self, sign=signs[self.sign])

    def __str__(self) -> str:
        return f"{self.metric} {self.sign} {self.value:g}"


@dataclass(frozen=True, kw_only=True)
class Demands:
    """The demands of a test on a drive.

    Attributes:
        outcome: required outcome of the run
        certified: whether the drive must be certified collision-free; None: if it must succeed
        touched: required kind of the first thing touched, one of `KINDS`; None: any, or none
        cause: required largest cause of the lost margin, one of `causes`; None: any
        bounds: bounds on metrics
        tolerances: allowed losses against the baseline that replace the metrics' own; None: not compared
        trajectory: largest distance from the baseline's line at any time [m]; "exact": bitwise the same drive; None: not
            compared
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
        """Return how much worse than the baseline a metric may be; None if it is not compared.

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
        """Parse demands as written in a suite.

        >>> Demands.of({"min_clearance_m": ">= 0.05"}, {"duration_s": "10 %", "jerk_rms": "any"}, 0.05)

        Args:
            expect: outcome, certified, the thing touched and the cause, and bounds on metrics such as ">= 5, <= 30"
            tolerance: by metric, or `end_m`: a number in its unit, a percentage such as "10 %", or "any"
            trajectory: a distance [m], or "exact"

        Raises:
            FieldError: a metric or outcome is unknown, or a value invalid.
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
    """Return the causes of lost margin. Importing them loads the compiler, which collecting tests does not need."""
    from antdrive.sim.log.margin import CAUSES

    return tuple(CAUSES)


def _of_a_contact(
    key: str, expect: Mapping[str, Any], choices: Callable[[], Sequence[str]], outcome: Outcome
) -> str | None:
    """Parse a demand on a contact; the outcome must be one with contact."""
    value = expect.get(key)
    if value is None:
        return None
    known = choices()
    if value not in known:
        raise FieldError(f"expect.{key}", f"unknown {show(value)}; choose from {', '.join(known)}")
    if not outcome.with_contact:
        raise FieldError(f"expect.{key}", f"outcome {outcome.key} has no contact; omit it")
    return str(value)


def _bounds(key: str, value: Any) -> list[Bound]:
    if key not in METRICS:
        known = [*NON_METRICS, *METRICS]
        raise FieldError(f"expect.{key}", f"unknown metric; {suggest(key, known)}")
    if key in WALL_CLOCK:
        raise FieldError(f"expect.{key}", "depends on the machine and its load; omit it")
    if isinstance(value, int | float) and not isinstance(value, bool):
        if METRICS[key].unit == "1" and float(value).is_integer():  # such as contacts_driving: 0
            return [Bound(key, "==", float(value))]
        sign = "<=" if METRICS[key].better == "lower" else ">="
        raise FieldError(f"expect.{key}", f'no drive has exactly this value; write a bound such as "{sign} {value:g}"')
    bounds = []
    for part in str(value).split(",") if isinstance(value, str) else [""]:
        match = _BOUND.fullmatch(part)
        if not match:
            raise FieldError(f"expect.{key}", f'must be a bound such as ">= 0.05" or ">= 5, <= 30", got {show(value)}')
        bounds.append(Bound(key, match[1], float(match[2])))
    return bounds


def _tolerance(key: str, value: Any) -> Tolerance | None:
    where = f"tolerance.{key}"
    if key not in METRICS and key != END:
        raise FieldError(where, f"unknown metric; {suggest(key, [*METRICS, END])}")
    if key != END and METRICS[key].better == "neither" and value != "any":
        raise FieldError(where, "neither higher nor lower is better; bound it in expect instead")
    if value == "any":
        return None
    share = _SHARE.fullmatch(value) if isinstance(value, str) else None
    if share and key == END:
        raise FieldError(where, f"must be a distance in metres, not a percentage, got {show(value)}")
    if share and float(share[1]) >= 0:
        return Tolerance(relative=float(share[1]) / 100)
    if isinstance(value, int | float) and not isinstance(value, bool) and 0 <= value < math.inf:
        return Tolerance(float(value))
    unit = "m" if key == END else METRICS[key].unit
    raise FieldError(
        where, f'must be a number of at least 0 [{unit}], a percentage such as "10 %", or any, got {show(value)}'
    )


def _trajectory(value: Any) -> float | Literal["exact"] | None:
    if value is None or value == "exact":
        return value  # type: ignore[no-any-return]
    if isinstance(value, int | float) and not isinstance(value, bool) and LEAST_TRAJECTORY <= value < math.inf:
        return float(value)
    raise FieldError(
        "trajectory", f"must be exact, or a distance of at least {LEAST_TRAJECTORY:g} m, got {show(value)}"
    )
