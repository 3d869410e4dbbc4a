"""A claim of a paper as one sentence that an experiment can refute, and the kinds of test."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

#: The margin of "no longer than" [points]: A = 0.56, where a small effect begins (Vargha & Delaney 2000), is 56 : 44.
SMALL_EFFECT = 12.0
#: What a claim judged with that margin says of it.
MARGIN_OURS = f"margin ours: {SMALL_EFFECT:g} points, where a small effect begins"


class Arm(NamedTuple):
    """One experiment of a paper.

    Attributes:
        map: the map's name
        name: the planner's, with its setting
    """

    map: str
    name: str


@dataclass(frozen=True)
class Less:
    """The first arm's values are below the second's: the median of the differences, pair by pair, is below the margin.

    Attributes:
        pairs: first and second arm, of the same map; the differences of all pairs count together
        quantity: a property of `Trial`
        margin: in the quantity's unit; a claim "no more than" holds up to it
        strict: whether a median difference of exactly the margin refutes the claim, or bears it out
        against: the second arm's quantity where it is another one
    """

    pairs: tuple[tuple[Arm, Arm], ...]
    quantity: str = "gap"
    margin: float = 0.0
    strict: bool = True
    against: str = ""


@dataclass(frozen=True)
class LessGain:
    """The first step gains less than the second: the median of the differences of the two gains is below 0.

    Attributes:
        first: the arms before and after the first step
        second: the arms before and after the second step, of the same map
        quantity: a property of `Trial`; what a step takes off it is its gain
    """

    first: tuple[Arm, Arm]
    second: tuple[Arm, Arm]
    quantity: str = "length"

    @property
    def pairs(self) -> tuple[tuple[Arm, Arm], ...]:
        """Both steps."""
        return (self.first, self.second)


@dataclass(frozen=True)
class Oftener:
    """The first arm's values are below the second's in more pairs than they are above.

    For values of which many are equal, as lengths on small maps: their median difference is 0 whatever the others are.

    Attributes:
        pairs: first and second arm, of the same map; all pairs count together
        quantity: a property of `Trial`
    """

    pairs: tuple[tuple[Arm, Arm], ...]
    quantity: str = "gap"


@dataclass(frozen=True)
class NoWorse:
    """The first arm's values are no higher than the second's: hardly in more pairs above than below.

    Two planners that are alike have a share above less share below of 0, of which an interval never says that it is 0 or
    less. So a small effect is let pass.

    Attributes:
        pairs: first and second arm, of the same map; all pairs count together
        quantity: a property of `Trial`
        margin: the largest share above less share below that still counts as none [points]
    """

    pairs: tuple[tuple[Arm, Arm], ...]
    quantity: str = "gap"
    margin: float = SMALL_EFFECT


@dataclass(frozen=True)
class Within:
    """The median of a quantity is at most a bound.

    Attributes:
        arms: the experiments, all counted together
        most: the bound
        quantity: a property of `Trial`
    """

    arms: tuple[Arm, ...]
    most: float
    quantity: str = "gap"


@dataclass(frozen=True)
class Mean:
    """The mean of a quantity is the printed value, within a share of it.

    Attributes:
        arm: the experiment
        value: the printed value
        quantity: a property of `Trial`; trials in which it is not finite are left out
        margin: the share
    """

    arm: Arm
    value: float
    quantity: str
    margin: float = 0.05


@dataclass(frozen=True)
class Arrive:
    """The share of the runs in which a planner finds a path.

    Attributes:
        arms: the experiments, all counted together
        least: at least this share
        most: at most this share
    """

    arms: tuple[Arm, ...]
    least: float = 0.0
    most: float = 1.0


@dataclass(frozen=True)
class MayFail:
    """There is a run in which a planner finds no path. One such run bears the claim out; none refutes it.

    Attributes:
        arms: the experiments, all counted together
    """

    arms: tuple[Arm, ...]


@dataclass(frozen=True)
class Wider:
    """The first arm's values scatter more than the second's: the range between their quartiles is wider.

    A quartile that no path reaches is infinite, and so is the range.

    Attributes:
        pair: first and second arm
        quantity: a property of `Trial`
    """

    pair: tuple[Arm, Arm]
    quantity: str = "gap"

    @property
    def pairs(self) -> tuple[tuple[Arm, Arm], ...]:
        """The one pair."""
        return (self.pair,)


@dataclass(frozen=True)
class Cases:
    """In how many cases the first arm's value is below the second's.

    Attributes:
        pairs: first and second arm, a case each
        quantity: a property of `Trial`
        least: in so many cases at least
        best_run: whether the least of an arm's values stands for it in the place of their median, as for times of equal work
    """

    pairs: tuple[tuple[Arm, Arm], ...]
    quantity: str
    least: int
    best_run: bool = False


Test = Less | LessGain | Oftener | NoWorse | Within | Mean | Arrive | MayFail | Wider | Cases


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A claim of a paper.

    Attributes:
        paper: the paper's short name
        source: section, table or figure
        sentence: what is claimed
        printed: the figures that the paper gives for it
        test: the statistic that decides, with its margin
        reading: "ours", or how the planner is read where that is not our default
        remark: what the figures do not say, and which margins and thresholds are ours, as the paper prints none
    """

    paper: Literal["han2007", "suganthi2019", "ibraheem2016", "lee2008", "hasan"]
    source: str
    sentence: str
    printed: str
    test: Test
    reading: str = "ours"
    remark: str = ""

    @property
    def arms(self) -> frozenset[Arm]:
        """The experiments that the test needs."""
        if isinstance(self.test, Mean):
            return frozenset({self.test.arm})
        if isinstance(self.test, (Arrive, MayFail, Within)):
            return frozenset(self.test.arms)
        return frozenset(arm for pair in self.test.pairs for arm in pair)


def pairs_on(maps: tuple[str, ...], first: str, second: str) -> tuple[tuple[Arm, Arm], ...]:
    """On each of these maps the arms of two planners."""
    return tuple((Arm(name, first), Arm(name, second)) for name in maps)


def arms_on(maps: tuple[str, ...], name: str) -> tuple[Arm, ...]:
    """On each of these maps the arm of a planner."""
    return tuple(Arm(here, name) for here in maps)
