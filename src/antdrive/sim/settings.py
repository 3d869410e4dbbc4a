"""Settings of a scenario, each declared once: type, bounds, default, help, and notation.

A new setting is a field of `Settings`; one that is neither a number nor a word also needs a form in
`antdrive.sim.forms`. Files, options, tables, keys, records and reference pages read `SETTINGS`. The module imports nothing
heavy, since the command line loads it.
"""

import dataclasses
import math
import numbers
import typing
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from annotated_types import Ge, Gt, Le

from antdrive.base.errors import FieldError
from antdrive.sim.policy import Perception, ReplanPolicy

if TYPE_CHECKING:
    from antdrive.robots import Avoidance, Controller, PurePursuit
    from antdrive.worlds import Disc

#: The panels of `--help`, in order.
PANELS = ("World", "Planner", "Robot", "Sensing", "Movers", "Output")
#: Sources of the robot's map and pose.
MAPS = ("given", "none")
LOCALISATIONS = ("fixes", "odometry", "matching", "true")
SMOOTHINGS = ("none", "taut", "clearance")
#: Default smoothing of compared planners, and of custom ones under test: others turn different plans into one route.
COMPARED_SMOOTHING = "none"
FOOTPRINTS = ("auto", "disc", "exact")
PHYSICS_HZ = (60, 10_000)  # slower physics makes the robot jerk
SLOWEST_CONTROL = 10  # [Hz]


@dataclass(frozen=True)
class Setting:
    """Notation of a scenario's field."""

    help: str  # description in files, in `--help` and on reference pages
    group: str  # panel of `--help`
    metavar: str = ""  # placeholder of the value in `--help`
    key: str = ""  # key in files, errors and tables; empty: the field's name
    flag: str | None = None  # option; None: `--` and the key; empty: no option
    form: str = "plain"  # name of the form of its values, see `antdrive.sim.forms`
    choices: tuple[str, ...] = ()  # allowed words
    axis: bool = False  # whether a campaign file lists values under its key; else under `settings`
    column: str = ""  # column of a campaign's table; empty: the key
    usual: str = ""  # meaning of the default None, for `--help`
    # version of the campaign-key format that added the setting; settings added after version 1 are omitted at their default
    since: int = 1


def _pursuit() -> "PurePursuit":
    from antdrive.robots import PurePursuit

    return PurePursuit()


def _avoidance() -> "Avoidance":
    from antdrive.robots import Avoidance

    return Avoidance()


def setting(default: Any, help: str, group: str, metavar: str = "", *bounds: Ge | Gt | Le, **notation: Any) -> Any:
    """Declare a setting as a field: its default, or a function that returns it; its notation; and the bounds of a number."""
    made = {"default_factory": default} if callable(default) else {"default": default}
    return field(**made, metadata={"setting": Setting(help, group, metavar, **notation), "bounds": bounds})


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Scenario fields other than task, planner and robot."""

    smoothing: str = setting(
        "clearance",
        "how the planned cells become a route: none (drive the cells), taut (shortest) or clearance (short, "
        "and away from obstacles where there is room)",
        "Planner",
        "KIND",
        choices=SMOOTHINGS,
        axis=True,
    )
    noise: float = setting(
        0.0,
        "factor on the robot's documented noise; 0 is a perfect robot",
        "Robot",
        "FACTOR",
        Ge(0),
        axis=True,
    )
    margin: float | None = setting(
        None,
        "clearance of plans on top of the robot's radius [m], or auto: the smallest margin predicted to suffice for robot, "
        "noise and smoothing, calibrated once with 80 short drives per candidate margin",
        "Planner",
        "METRES|auto",
        Ge(0),
        form="margin",
        axis=True,
        column="margin_asked",
        usual="at least 0.03, by robot, noise and smoothing",
    )
    cell: float | None = setting(
        None,
        "side of a grid cell [m]",
        "Planner",
        "METRES",
        Gt(0),
        usual="the world's own; at most 0.05 without a map, and for footprints unless ants find a way on larger ones",
    )
    footprint: str = setting(
        "auto",
        "the shape that plans keep clear: disc (the circle around the robot), exact (its footprint, which turns on the "
        "spot and drives straight), or auto (the disc; the exact footprint where the disc's path is missing or over "
        "10 % longer; ants compare paths on the world's cells)",
        "Planner",
        "auto|disc|exact",
        choices=FOOTPRINTS,
        since=2,
    )
    map: str = setting(
        "given",
        "the robot's map before the drive: given (the whole world), or none (only what its lidar detects)",
        "Sensing",
        "given|none",
        choices=MAPS,
        since=2,
    )
    localisation: str = setting(
        "fixes",
        "the robot's pose estimate: fixes (with the robot's noise; with map none fused with matching), odometry (wheels "
        "and gyro, which drift), matching (odometry corrected by scan matching; needs map none) or true (without error)",
        "Sensing",
        "KIND",
        choices=LOCALISATIONS,
        since=2,
    )
    odometry: float = setting(
        1.0,
        "factor on the documented errors of odometry",
        "Sensing",
        "FACTOR",
        Ge(0),
        since=2,
    )
    controller: "Controller" = setting(  # noqa: RUF009
        _pursuit,
        "the controller: a name, FILE.py:CLASS or MODULE:CLASS; in files also {name: NAME} with options",
        "Robot",
        "NAME",
        usual="pure-pursuit",
        form="controller",
    )
    perception: Perception | None = setting(  # noqa: RUF009
        None,
        "perception of movers, KIND or KIND:METRES: ground-truth positions, velocities or motions (their whole future), or "
        "lidar (tracks from scans); with METRES, only within that range [m]",
        "Movers",
        "KIND[:METRES]",
        key="sees",
        form="perception",
        usual="velocities; lidar without a map",
    )
    avoidance: "Avoidance | None" = setting(  # noqa: RUF009
        _avoidance,
        "local avoidance of movers: true, false or none, or settings such as {horizon: 2.0}",
        "Movers",
        key="avoid",
        form="avoidance",
    )
    replanning: ReplanPolicy | None = setting(  # noqa: RUF009
        ReplanPolicy,
        "replanning: true (around movers), false (only after deviations from the route), none (never), or settings such as "
        "{patience: 10}",
        "Movers",
        key="replan",
        form="replanning",
    )
    unseen: "tuple[Disc, ...]" = setting(  # noqa: RUF009
        (), "cylinders {x, y, radius} [m] unknown to planner and controller", "World", "X,Y,RADIUS", form="discs"
    )
    time_limit: float | None = setting(
        None,
        "simulated time allowed [s]",
        "World",
        "SECONDS",
        Gt(0),
        usual="the world's own, or 30 s plus ten times the route at full speed",
    )
    physics_hz: int = setting(
        240,
        "physics steps per simulated second, 60 to 10000",
        "Robot",
        "",
        Ge(PHYSICS_HZ[0]),
        Le(PHYSICS_HZ[1]),
        flag="",
    )
    control_hz: int = setting(
        60,
        "control periods per simulated second, at least 10; must divide physics_hz",
        "Robot",
        "",
        Ge(SLOWEST_CONTROL),
        flag="",
    )
    seed: int = setting(
        0,
        "seed of all random numbers",
        "World",
        "NUMBER",
        Ge(0),
        Le(2**63 - 1),
        axis=True,
    )

    def __post_init__(self) -> None:
        for one in SETTINGS.values():
            one.check(getattr(self, one.name))


@dataclass(frozen=True)
class DeclaredSetting:
    """Setting as declared in `Settings`."""

    name: str  # the scenario's field
    kind: Any  # the field's type; types of other records as text
    optional: bool  # whether None is a valid value
    bounds: tuple[Ge | Gt | Le, ...]  # bounds of numbers, as pydantic takes them
    setting: Setting  # its notation
    field: "dataclasses.Field[Any]"  # the record's field

    @property
    def key(self) -> str:
        """Key in files, errors and tables."""
        return self.setting.key or self.name

    @property
    def flag(self) -> str:
        """Command option; empty: there is none."""
        return f"--{self.key.replace('_', '-')}" if self.setting.flag is None else self.setting.flag

    @property
    def column(self) -> str:
        """Column of a campaign's table."""
        return self.setting.column or self.key

    @property
    def is_word(self) -> bool:
        """Whether a single word is a value, so that a list of words is a list of values; seeds have their own notation."""
        return self.setting.form in ("plain", "margin", "perception", "controller") and self.name != "seed"

    @property
    def default(self) -> Any:
        """Default value of a scenario."""
        made = self.field.default_factory
        return self.field.default if made is dataclasses.MISSING else made()

    def keys(self, value: Any) -> list[str]:
        """Return the keys under which a value differs from the default: those of changed options, or the setting's own."""
        if value == self.default:
            return []
        if self.setting.form != "controller" or type(value) is not type(self.default):
            return [self.key]
        names = (one.name for one in dataclasses.fields(value))
        return [f"{self.key}.{name}" for name in names if getattr(value, name) != getattr(self.default, name)]

    def check(self, value: Any) -> None:
        """Raise FieldError for a value of the wrong type, a number out of bounds or an unknown word."""
        if self.kind not in (int, float, str) or (value is None and self.optional):
            return
        choices = self.setting.choices
        if choices and value not in choices:
            raise FieldError(self.key, f"unknown {value!r:.60}; choose from {', '.join(choices)}")
        wanted: Any = {int: numbers.Integral, float: numbers.Real, str: str}[self.kind]
        if not isinstance(value, wanted) or isinstance(value, bool):
            words = {int: "a whole number", float: "a number", str: "text"}[self.kind]
            raise FieldError(self.key, f"must be {words}, got {value!r:.60}")
        if self.kind is not str and not (math.isfinite(value) and all(_keeps(bound, value) for bound in self.bounds)):
            raise FieldError(self.key, f"must be {self.range}, got {value:g}")

    @property
    def range(self) -> str:
        """Bounds in words."""
        ends = {type(bound): getattr(bound, type(bound).__name__.lower()) for bound in self.bounds}
        if Ge in ends and Le in ends:
            return f"between {ends[Ge]} and {ends[Le]}"
        return f"at least {ends[Ge]:g}" if Ge in ends else f"greater than {ends[Gt]:g}"


def _keeps(bound: Ge | Gt | Le, value: Any) -> bool:
    if isinstance(bound, Le):
        return bool(value <= bound.le)
    return bool(value >= bound.ge) if isinstance(bound, Ge) else bool(value > bound.gt)


def declared(kind: type[Any]) -> Iterator[DeclaredSetting]:
    """Yield the settings that a record declares, in the order of its fields."""
    for one in dataclasses.fields(kind):
        of = typing.get_args(one.type)
        optional, kind_of = type(None) in of, of[0] if type(None) in of else one.type
        yield DeclaredSetting(one.name, kind_of, optional, one.metadata["bounds"], one.metadata["setting"], one)


#: Settings of a scenario by field name, in the order of tables.
SETTINGS: Mapping[str, DeclaredSetting] = MappingProxyType({one.name: one for one in declared(Settings)})


def part_of_key(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields that identify a scenario. Fields added later are omitted at their default, so keys stay valid."""
    known = (one for one in SETTINGS.values() if one.name in fields)
    return {one.name: fields[one.name] for one in known if one.setting.since == 1 or fields[one.name] != one.default}


def tested_settings(given: Mapping[str, Any], *, custom: bool) -> dict[str, Any]:
    """Return the settings of a test by key: a custom planner drives its own plan unless a smoothing is given."""
    return {**({"smoothing": COMPARED_SMOOTHING} if custom else {}), **given}


def _columns() -> Iterator[tuple[str, str]]:
    for one in SETTINGS.values():
        plain = one.setting.form == "plain"
        yield one.column, {float: "double", int: "int64"}.get(one.kind, "string") if plain else "string"
        if one.column != one.key:
            yield one.key, "double"


#: Columns of settings in a campaign's table and their types; the driven margin follows the requested one.
SETTING_COLUMNS: Mapping[str, str] = MappingProxyType(dict(_columns()))

Settings.__doc__ = "\n".join(
    [
        f"{Settings.__doc__}\n\nAttributes:",
        *(f"    {one.name}: {one.setting.help}" for one in SETTINGS.values()),
    ]
)
