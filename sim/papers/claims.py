"""What the papers claim, each as one sentence that an experiment can refute."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple


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
    """

    pairs: tuple[tuple[Arm, Arm], ...]
    quantity: str = "gap"
    margin: float = 0.0
    strict: bool = True


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
    """The share of the seeds with which a planner finds a path.

    Attributes:
        arm: the experiment
        least: at least this share
        most: at most this share
    """

    arm: Arm
    least: float = 0.0
    most: float = 1.0


@dataclass(frozen=True)
class Wider:
    """The first arm's values scatter more than the second's: the range between their quartiles is wider.

    A quartile that no path reaches is infinite, and so is the range.

    Attributes:
        pairs: first and second arm
        quantity: a property of `Trial`
    """

    pairs: tuple[tuple[Arm, Arm], ...]
    quantity: str = "gap"


@dataclass(frozen=True)
class Cases:
    """Without chance: in how many cases the first arm's value is below the second's.

    Attributes:
        pairs: first and second arm, a case each
        quantity: a property of `Trial`
        least: in so many cases at least
    """

    pairs: tuple[tuple[Arm, Arm], ...]
    quantity: str
    least: int


Test = Less | Oftener | Within | Mean | Arrive | Wider | Cases


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
        remark: what the figures do not say
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
        if isinstance(self.test, (Mean, Arrive)):
            return frozenset({self.test.arm})
        if isinstance(self.test, Within):
            return frozenset(self.test.arms)
        return frozenset(arm for pair in self.test.pairs for arm in pair)


def _pairs(maps: tuple[str, ...], first: str, second: str) -> tuple[tuple[Arm, Arm], ...]:
    return tuple((Arm(name, first), Arm(name, second)) for name in maps)


def _arms(maps: tuple[str, ...], name: str) -> tuple[Arm, ...]:
    return tuple(Arm(here, name) for here in maps)


MANY, ONE = "14 obstacles", "one obstacle of radius 5"

HAN2007 = (
    *(
        Claim(
            paper="han2007",
            source="§5.2, Table 5.2.1",
            sentence=f"The mean path of ten trials with {ants} ants has the printed length",
            printed=str(value),
            test=Mean(Arm(MANY, f"{ants} ants"), value, quantity),
            reading=reading,
        )
        for reading, quantity in (("mean of the last iteration's best", "last"), ("mean of the run's best", "length"))
        for ants, value in ((10, 45.357), (100, 38.6223), (500, 36.237))
    ),
    Claim(
        paper="han2007",
        source="§5.2, experiment 6",
        sentence="100 ants find shorter paths than 10",
        printed="38.62 < 45.36",
        test=Less(((Arm(MANY, "100 ants"), Arm(MANY, "10 ants")),), "length"),
    ),
    Claim(
        paper="han2007",
        source="§5.2, experiment 6",
        sentence="500 ants are little better than 100: by at most 7 % of the length",
        printed="36.24, 38.62",
        test=Less(((Arm(MANY, "100 ants"), Arm(MANY, "500 ants")),), "length", margin=2.5, strict=False),
        remark="2.5 cells are 7 %",
    ),
    Claim(
        paper="han2007",
        source="§5.2, experiments 1 and 2",
        sentence="With an elite the best path of an iteration varies less once it has settled",
        printed="figures 5.2.2 and 5.2.6",
        test=Less(((Arm(MANY, "100 ants, elite"), Arm(MANY, "100 ants")),), "unrest"),
        remark="standard deviation over the last ten iterations",
    ),
    Claim(
        paper="han2007",
        source="§5.1, experiment 4",
        sentence="The genetic algorithm finds shorter paths with three via points than with one",
        printed="33.18 with three, the best",
        test=Less(((Arm(ONE, "3 via points"), Arm(ONE, "1 via point")),), "length"),
        remark="one via point suffices: the shortest line around one disc touches it from one side",
    ),
    Claim(
        paper="han2007",
        source="§5.1, experiment 4",
        sentence="More via points need more generations to converge",
        printed="–",
        test=Less(((Arm(ONE, "1 via point"), Arm(ONE, "3 via points")),), "settled"),
    ),
    Claim(
        paper="han2007",
        source="§5.1, experiment 5",
        sentence="Elitism gives shorter paths at the end of the genetic algorithm",
        printed="figures 5.1.9 and 5.1.10",
        test=Less(((Arm(ONE, "3 via points"), Arm(ONE, "3 via points, no elite")),), "last"),
    ),
    Claim(
        paper="han2007",
        source="§5.1, experiment 5",
        sentence="With elitism a higher mutation rate gives shorter paths: 0.8 shorter ones than 0.2",
        printed="figure 5.1.10",
        test=Less(((Arm(ONE, "3 via points, Pm 0.8"), Arm(ONE, "3 via points")),), "last"),
    ),
    Claim(
        paper="han2007",
        source="§5.1, experiment 5",
        sentence="Without elitism it does not",
        printed="figure 5.1.10",
        test=Less(
            ((Arm(ONE, "3 via points, no elite"), Arm(ONE, "3 via points, Pm 0.8, no elite")),),
            "last",
            margin=0.5,
            strict=False,
        ),
        remark="up to half a cell",
    ),
    Claim(
        paper="han2007",
        source="§6.0",
        sentence="The genetic algorithm's paths are shorter than the ants'",
        printed="–",
        test=Less(((Arm(MANY, "4 via points"), Arm(MANY, "500 ants")),), "length"),
    ),
    Claim(
        paper="han2007",
        source="§5.2, experiment 5",
        sentence="With many obstacles and too few via points the genetic algorithm may fail to find a path",
        printed="–",
        test=Arrive(Arm(MANY, "1 via point"), most=0.5),
        remark="one via point, 20 000 random chromosomes",
    ),
)

SIZES = ("10×10", "20×20", "30×30", "50×50")


def _suganthi(reading: str, ants: str, improved: str, margin: float = 2.5) -> tuple[Claim, ...]:
    """The claims on one reading; `margin` is what counts as no longer [% of the shortest path].

    One diagonal move that is missed is 2.05 % of the shortest path at 20 x 20.
    """
    printed = ("13.899, 13.899", "28.627, 28.627", "42.184, 46.527", "94.326, 96.125")
    return (
        *(
            Claim(
                paper="suganthi2019",
                source="Table 2",
                sentence=f"At {size} IACO's path is no longer than ACO's",
                printed=lengths,
                test=Less(_pairs((size,), improved, ants), margin=margin, strict=False),
                reading=reading,
                remark=f"up to {margin:g} % of the shortest path",
            )
            for size, lengths in zip(SIZES, printed, strict=True)
        ),
        Claim(
            paper="suganthi2019",
            source="Table 2",
            sentence="At 10×10 and 20×20 IACO finds the shortest path, or nearly: within 2.5 %",
            printed="13.899, 28.627",
            test=Within(_arms(SIZES[:2], improved), 2.5),
            reading=reading,
        ),
        Claim(
            paper="suganthi2019",
            source="§V",
            sentence="At 50×50 ACO finds no path within 100 iterations",
            printed="none by the text, 96.125 by Table 2",
            test=Arrive(Arm(SIZES[3], ants), most=0.1),
            reading=reading,
            remark="text and table contradict each other",
        ),
        Claim(
            paper="suganthi2019",
            source="§V, Table 2",
            sentence="At 50×50 IACO finds a path within 100 iterations",
            printed="94.326",
            test=Arrive(Arm(SIZES[3], improved), least=0.9),
            reading=reading,
        ),
    )


SUGANTHI2019 = (
    *_suganthi("ours", "as", "iaco"),
    *_suganthi("a = 1", "as", "iaco, a = 1"),
    *_suganthi("a = 1, ants die in dead ends, loops stay", "as, ants die", "iaco, ants die", margin=5.0),
    Claim(
        paper="suganthi2019",
        source="Table 2",
        sentence="At 30×30 IACO's path is shorter than ACO's",
        printed="42.184 < 46.527",
        test=Oftener(_pairs(SIZES[2:3], "iaco", "as")),
    ),
    Claim(
        paper="suganthi2019",
        source="§V, Fig. 6",
        sentence="At 10×10 and 20×20 IACO converges about as fast as ACO: at most 10 iterations later",
        printed="figure 6",
        test=Less(_pairs(SIZES[:2], "iaco", "as"), "near", margin=10.0, strict=False),
        remark="iterations to a path within 5 % of the shortest",
    ),
    Claim(
        paper="suganthi2019",
        source="§V, Fig. 6",
        sentence="At 30×30 IACO converges in fewer iterations than ACO",
        printed="figure 6",
        test=Less(_pairs(SIZES[2:3], "iaco", "as"), "near"),
        remark="iterations to a path within 5 % of the shortest",
    ),
    Claim(
        paper="suganthi2019",
        source="Table 2",
        sentence="From 20×20 on PFACO's paths are longer than IACO's",
        printed="38.627 > 28.627, 59.355 > 42.184, 109.761 > 94.326",
        test=Less(_pairs(SIZES[1:], "iaco", "pfaco")),
        remark="109.761 is the length of no path over square cells",
    ),
    Claim(
        paper="suganthi2019",
        source="§V",
        sentence="PFACO is not stable: from 20×20 on its lengths scatter more than IACO's",
        printed="–",
        test=Wider(_pairs(SIZES[1:], "pfaco", "iaco")),
    ),
)

_no_more: Callable[..., Test] = functools.partial(Less, strict=False)
SQUARES = ("10×10, 5 obstacles", "20×20, 10 obstacles", "30×30, 15 obstacles", "40×40, 20 obstacles")

IBRAHEEM2016 = (
    *(
        Claim(
            paper="ibraheem2016",
            source="Table 2",
            sentence=f"At {size.split(',')[0]} MACO's path is no longer than ACO's",
            printed=lengths,
            test=Less(_pairs((size,), "maco", "as"), strict=False),
        )
        for size, lengths in zip(
            SQUARES, ("15.07, 15.07", "28.6274, 28.6274", "45.1127, 45.9411", "61.8406, 62.6690"), strict=True
        )
    ),
    Claim(
        paper="ibraheem2016",
        source="Table 2",
        sentence="At 30×30 and 40×40 MACO's path is shorter than ACO's",
        printed="45.1127 < 45.9411, 61.8406 < 62.6690",
        test=Oftener(_pairs(SQUARES[2:], "maco", "as")),
    ),
    Claim(
        paper="ibraheem2016",
        source="§7.2.2",
        sentence="MACO reaches its best path in fewer iterations than ACO",
        printed="58 < 78, 31 < 79, 92 < 97, 96 = 96",
        test=Less(_pairs(SQUARES, "maco", "as"), "settled"),
    ),
    Claim(
        paper="ibraheem2016",
        source="§7.1, Table 2",
        sentence="At 10×10 and 20×20 ACO finds the shortest path",
        printed="15.07, 28.6274",
        test=Within(_arms(SQUARES[:2], "as"), 0.0),
    ),
)

IBRAHEEM2016 += (
    *(
        Claim(
            paper="ibraheem2016",
            source="§7.1, Fig. 8",
            sentence=f"At {size.split(',')[0]} {sentence}",
            printed="figure 8",
            test=kind(((Arm(size, f"as, {enough} ants"), Arm(size, rival)),)),
        )
        for size, enough in zip(SQUARES, (20, 40), strict=False)
        for sentence, rival, kind in (
            (f"{enough} ants are enough: 50 find no shorter path", "as", _no_more),
            (f"{enough} ants find shorter paths than 5", "as, 5 ants", Oftener),
        )
    ),
    *(
        Claim(
            paper="ibraheem2016",
            source="§7.1, Fig. 9",
            sentence="At 20×20 paths are shorter with rho between 0.3 and 0.7 than outside",
            printed="figure 9",
            test=Oftener(((Arm(SQUARES[1], inside), Arm(SQUARES[1], f"as, rho {outside}")),)),
            reading=reading,
        )
        for inside, outside, reading in (("as", "0.1", "0.3 against 0.1"), ("as, rho 0.7", "0.9", "0.7 against 0.9"))
    ),
)

LEE = ("1: 25×25", "2: 50×44", "3: 100×100", "4: 100×100", "5: 100×100")
LEE_PRINTED = ("59.25 < 72.08", "64.08 < 83.40", "123.61 < 154.24", "135.82 < 175.24", "131.68 < 168.65")

LEE2008 = (
    *(
        Claim(
            paper="lee2008",
            source="Tables I and II",
            sentence=f"On map {name[0]} PFACO's path is shorter than ACO's",
            printed=printed,
            test=Less(_pairs((name,), "pfaco", "as")),
            remark="equal ant steps",
        )
        for name, printed in zip(LEE, LEE_PRINTED, strict=True)
    ),
    Claim(
        paper="lee2008",
        source="Tables I and II",
        sentence="On map 1 PFACO's path is shorter than ACO's",
        printed=LEE_PRINTED[0],
        test=Less(_pairs(LEE[:1], "pfaco, stepping back", "as")),
        reading="ants step back out of dead ends",
        remark="equal ant steps",
    ),
    Claim(
        paper="lee2008",
        source="§V",
        sentence="On the maps of 100×100 cells PFACO's paths are acceptable: within 15 % of the shortest",
        printed="123.61, 135.82, 131.68",
        test=Within(_arms(LEE[2:], "pfaco, stepping back"), 15.0),
        reading="ants step back out of dead ends",
    ),
    Claim(
        paper="lee2008",
        source="§V",
        sentence="On the maps of 100×100 cells PFACO's paths are acceptable: within 15 % of the shortest",
        printed="123.61, 135.82, 131.68",
        test=Within(_arms(LEE[2:], "pfaco"), 15.0),
        remark="the paper gives no margin; 15 % is ours",
    ),
    Claim(
        paper="lee2008",
        source="Tables I and II",
        sentence="PFACO is faster: on the maps of 100×100 cells it takes fewer ant steps than ACO to a path within 25 %",
        printed="1063–1593 s, 16552–22641 s",
        test=Less(_pairs(LEE[2:], "pfaco", "as"), "effort"),
    ),
    Claim(
        paper="lee2008",
        source="§V",
        sentence="On the maps of 100×100 cells PFACO's paths are acceptable: within 15 % of the shortest",
        printed="123.61, 135.82, 131.68",
        test=Within(_arms(LEE[2:], "pfaco, to the letter"), 15.0),
        reading="U_j attracts, and ants return to cells",
    ),
    Claim(
        paper="lee2008",
        source="Tables I and II",
        sentence="On the maps of 100×100 cells PFACO's paths are shorter than ACO's",
        printed="; ".join(LEE_PRINTED[2:]),
        test=Less(_pairs(LEE[2:], "pfaco, to the letter", "as")),
        reading="U_j attracts, and ants return to cells",
        remark="equal ant steps",
    ),
)

CASES = (
    *("1a curved walls", "2b overlapping curved walls", "3c vertical rows"),
    *("4d concentric circles", "5e many shapes", "5f the same, across the wall"),
)


def _hasan(rival: str, reading: str) -> tuple[Claim, ...]:
    pairs = _pairs(CASES, "mmas-dstar", rival)
    return (
        Claim(
            paper="hasan",
            source="Table 1",
            sentence="The total path cost is below that of D* in at least five of the six environments",
            printed="lower in 5, equal in 3c",
            test=Cases(pairs, "total", 5),
            reading=reading,
        ),
        Claim(
            paper="hasan",
            source="Table 1",
            sentence="It is faster than D* in all six environments: fewer cells get pheromone than D* costs",
            printed="2.96–5.64 s, 3.49–32.89 s",
            test=Cases(pairs, "work", 6),
            reading=reading,
        ),
    )


HASAN = (
    *_hasan("dstar", "D* is optimal"),
    *_hasan("D* that lowers no cost", "D* lowers no cost"),
)

#: All claims, in the order of the papers.
CLAIMS: tuple[Claim, ...] = (*HAN2007, *SUGANTHI2019, *IBRAHEEM2016, *LEE2008, *HASAN)
