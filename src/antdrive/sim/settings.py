"""The settings of a scenario, each declared once: type, bounds, default, help, and how people write it.

A new setting is a field of `Settings`; one that is neither a number nor a word needs a form in `antdrive.sim.forms`, too. Files,
options, tables, keys, records and reference pages are read from `SETTINGS`. Imports nothing heavy: the command line does.
"""

import dataclasses
import math
import numbers
import typing
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any

from annotated_types import Ge, Gt, Le

from antdrive.base.errors import FieldError
from antdrive.sim.policy import Perception, ReplanPolicy

if TYPE_CHECKING:
    from antdrive.robots import Avoidance, PurePursuit
    from antdrive.worlds import Disc

#: The panels of `--help`, in order.
PANELS = ("World", "Planner", "Robot", "Sensing", "Movers", "Output")
#: What a robot may know of the world before it drives, and how it may know its pose.
MAPS = ("given", "none")
LOCALISATIONS = ("fixes", "odometry", "matching", "true")
SMOOTHINGS = ("none", "taut", "clearance")
PHYSICS_HZ = (60, 10_000)  # slower physics jolts the robot
SLOWEST_CONTROL = 10  # [Hz]


@dataclass(frozen=True)
class Setting:
    """How people write a field of a scenario."""

    help: str  # the description, in files, in `--help` and on reference pages
    group: str  # the panel of `--help`
    metavar: str = ""  # what `--help` calls the value
    key: str = ""  # the key in files, in errors and in tables; empty: the field's name
    flag: str | None = None  # the option; None: the key with `--`; empty: there is none
    form: str = "plain"  # how values are written, see `antdrive.sim.forms`
    choices: tuple[str, ...] = ()  # the words that the field can be
    axis: bool = False  # whether a campaign file lists values under its key; else it is one of the `settings`
    column: str = ""  # the column in a campaign's table; empty: the key
    usual: str = ""  # what the default None means, for `--help`
    # the format of a campaign's keys that the setting joined in; later ones are left out at their default
    since: int = 1


def _pursuit() -> "PurePursuit":
    from antdrive.robots import PurePursuit

    return PurePursuit()


def _avoidance() -> "Avoidance":
    from antdrive.robots import Avoidance

    return Avoidance()


@dataclass(frozen=True, kw_only=True)
class Settings:
    """The fields of a scenario beside task, planner and robot."""

    smoothing: Annotated[
        str,
        Setting(
            "how the planned cells become a route: none (drive the cells), taut (as short as possible) or clearance (short, "
            "and away from obstacles where there is room)",
            "Planner",
            "KIND",
            choices=SMOOTHINGS,
            axis=True,
        ),
    ] = "clearance"
    noise: Annotated[
        float,
        Ge(0),
        Setting(
            "factor on the noise that the robot's file documents; 0 is a perfect robot", "Robot", "FACTOR", axis=True
        ),
    ] = 0.0
    margin: Annotated[
        float,
        Ge(0),
        Setting(
            "distance that plans keep from obstacles, beyond the robot's radius [m], or auto: the least that robot, noise and "
            "smoothing are predicted to need, from 80 short drives for each margin that is tried, once",
            "Planner",
            "METRES|auto",
            form="margin",
            axis=True,
            column="margin_asked",
        ),
    ] = 0.03
    cell: Annotated[
        float | None,
        Gt(0),
        Setting("side of a grid cell [m]", "Planner", "METRES", usual="the world's own; without a map 0.05 at most"),
    ] = None
    map: Annotated[
        str,
        Setting(
            "what the robot knows of the world before it drives: given (all of it), or none (only what its lidar sees)",
            "Sensing",
            "given|none",
            choices=MAPS,
            since=2,
        ),
    ] = "given"
    localisation: Annotated[
        str,
        Setting(
            "how the robot knows its pose: fixes (with the noise of its file), odometry (wheels and gyro, which drift), "
            "matching (odometry, corrected by scan matching; needs map none) or true (without error)",
            "Sensing",
            "KIND",
            choices=LOCALISATIONS,
            since=2,
        ),
    ] = "fixes"
    odometry: Annotated[
        float, Ge(0), Setting("factor on the documented errors of odometry", "Sensing", "FACTOR", since=2)
    ] = 1.0
    controller: Annotated[
        "PurePursuit",
        Setting("settings of the controller, such as {lookahead_time: 0.5}", "Robot", flag="", form="controller"),
    ] = field(default_factory=_pursuit)
    perception: Annotated[
        Perception | None,
        Setting(
            "what the robot perceives of movers, KIND or KIND:METRES: positions, velocities, motions (their whole future), or "
            "lidar (only what its lidar shows); with METRES, only of movers within that range [m]",
            "Movers",
            "KIND[:METRES]",
            key="sees",
            form="perception",
            usual="velocities; without a map lidar",
        ),
    ] = None
    avoidance: Annotated[
        "Avoidance | None",
        Setting(
            "whether the robot avoids movers: true, false or none, or settings such as {horizon: 2.0}",
            "Movers",
            key="avoid",
            form="avoidance",
        ),
    ] = field(default_factory=_avoidance)
    replanning: Annotated[
        ReplanPolicy | None,
        Setting(
            "whether the robot replans around movers, or only after it has strayed from its route: true, false, none (never) or "
            "settings such as {patience: 10}",
            "Movers",
            key="replan",
            form="replanning",
        ),
    ] = field(default_factory=ReplanPolicy)
    unseen: Annotated[
        "tuple[Disc, ...]",
        Setting(
            "cylinders {x, y, radius} [m] that neither planner nor controller knows of",
            "World",
            "X,Y,RADIUS",
            form="discs",
        ),
    ] = ()
    time_limit: Annotated[
        float | None,
        Gt(0),
        Setting(
            "simulated time allowed [s]",
            "World",
            "SECONDS",
            usual="the world's own, or 30 s plus ten times the route at full speed",
        ),
    ] = None
    physics_hz: Annotated[
        int,
        Ge(PHYSICS_HZ[0]),
        Le(PHYSICS_HZ[1]),
        Setting("physics steps per simulated second, 60 to 10000", "Robot", flag=""),
    ] = 240
    control_hz: Annotated[
        int,
        Ge(SLOWEST_CONTROL),
        Setting("control periods per simulated second, at least 10; must divide physics_hz", "Robot", flag=""),
    ] = 60
    seed: Annotated[int, Ge(0), Le(2**63 - 1), Setting("seed of all random numbers", "World", "NUMBER", axis=True)] = 0

    def __post_init__(self) -> None:
        for one in SETTINGS.values():
            one.check(getattr(self, one.name))


@dataclass(frozen=True)
class DeclaredSetting:
    """A setting as declared in `Settings`."""

    name: str  # the field of the scenario
    kind: Any  # the field's type; that of other records as text
    optional: bool  # whether None is a value
    bounds: tuple[Ge | Gt | Le, ...]  # of numbers, as pydantic takes them
    setting: Setting  # how people write it
    field: "dataclasses.Field[Any]"  # the field of the record

    @property
    def key(self) -> str:
        """The key in files, in errors and in tables."""
        return self.setting.key or self.name

    @property
    def flag(self) -> str:
        """The option of commands; empty: there is none."""
        return f"--{self.key.replace('_', '-')}" if self.setting.flag is None else self.setting.flag

    @property
    def column(self) -> str:
        """The column in a campaign's table."""
        return self.setting.column or self.key

    @property
    def is_word(self) -> bool:
        """Whether one word writes a value, so that a list of words can write several; seeds have a notation of their own."""
        return self.setting.form in ("plain", "margin", "perception") and self.name != "seed"

    @property
    def default(self) -> Any:
        """The value of a scenario that does not say."""
        made = self.field.default_factory
        return self.field.default if made is dataclasses.MISSING else made()

    def check(self, value: Any) -> None:
        """Refuse a number of another kind or beyond its bounds, and a word that is none of the choices."""
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
        """The bounds in words."""
        ends = {type(bound): getattr(bound, type(bound).__name__.lower()) for bound in self.bounds}
        if Ge in ends and Le in ends:
            return f"between {ends[Ge]} and {ends[Le]}"
        return f"at least {ends[Ge]:g}" if Ge in ends else f"greater than {ends[Gt]:g}"


def _keeps(bound: Ge | Gt | Le, value: Any) -> bool:
    if isinstance(bound, Le):
        return bool(value <= bound.le)
    return bool(value >= bound.ge) if isinstance(bound, Ge) else bool(value > bound.gt)


def declared(kind: type[Any]) -> Iterator[DeclaredSetting]:
    """The settings that a record declares, in the order of its fields."""
    for one in dataclasses.fields(kind):
        base, *notes = typing.get_args(one.type)
        of = typing.get_args(base)
        optional = type(None) in of
        setting = next(note for note in notes if isinstance(note, Setting))
        bounds = tuple(note for note in notes if isinstance(note, Ge | Gt | Le))
        yield DeclaredSetting(one.name, of[0] if optional else base, optional, bounds, setting, one)


#: Every setting of a scenario by the name of its field, in the order of tables.
SETTINGS: Mapping[str, DeclaredSetting] = MappingProxyType({one.name: one for one in declared(Settings)})


def part_of_key(fields: Mapping[str, Any], without: Collection[str] = ()) -> dict[str, Any]:
    """The fields that a scenario is known by; those that came later are left out at their default, so keys stay valid."""
    known = (one for one in SETTINGS.values() if one.name in fields and one.name not in without)
    return {one.name: fields[one.name] for one in known if one.setting.since == 1 or fields[one.name] != one.default}


def _columns() -> Iterator[tuple[str, str]]:
    for one in SETTINGS.values():
        plain = one.setting.form == "plain"
        yield one.column, {float: "double", int: "int64"}.get(one.kind, "string") if plain else "string"
        if one.column != one.key:
            yield one.key, "double"


#: The columns of settings in a campaign's table and their types; the margin that was driven with follows the one asked for.
SETTING_COLUMNS: Mapping[str, str] = MappingProxyType(dict(_columns()))

Settings.__doc__ = "\n".join(
    [
        f"{Settings.__doc__}\n\nAttributes:",
        *(f"    {one.name}: {one.setting.help}" for one in SETTINGS.values()),
    ]
)
