"""What the papers claim, each as one sentence that an experiment can refute."""

from __future__ import annotations

from antdrive.runs.papers.kinds import (
    MARGIN_OURS,
    Arm,
    Arrive,
    Cases,
    Claim,
    Less,
    LessGain,
    MayFail,
    Mean,
    NoWorse,
    Oftener,
    Wider,
    Within,
    arms_on,
    pairs_on,
)

MANY, ONE, SMALL, EMPTY = "14 obstacles", "one obstacle of radius 5", "one obstacle of radius 1", "no obstacle"
WALLS = "two walls of obstacles"
MEAN_OURS = "margin ours: 5 %"
LISTED = "the thesis does not say which map this was; these fourteen obstacles stand in its program as a comment"
CLOSE_OURS = "threshold ours: within 25 % of the shortest"
NEAR_OURS = "threshold ours: within 5 % of the shortest"
LAST_TEN = "standard deviation over ten iterations; their number is ours"
ELITE_100 = "e = 100, ours"


def _genes(setting: str) -> Arm:
    return Arm(ONE, f"3 via points, {setting}")


HAN2007 = (
    *(
        Claim(
            paper="han2007",
            source="§5.2, Table 5.2.1",
            sentence=f"The mean path of ten trials with {ants} ants has the printed length",
            printed=str(value),
            test=Mean(Arm(place, f"{ants} ants"), value, quantity),
            reading=reading,
            remark=f"{MEAN_OURS}; {remark}",
        )
        for reading, place, quantity, remark in (
            ("mean of the last iteration's best", MANY, "last", LISTED),
            ("mean of the run's best", MANY, "length", LISTED),
            ("mean of the last iteration's best, the one obstacle of the program", SMALL, "last", "another map"),
        )
        for ants, value in ((10, 45.357), (100, 38.6223), (500, 36.237))
    ),
    *(
        claim
        for reading, quantity in (("the last iteration's best", "last"), ("the run's best", "length"))
        for claim in (
            Claim(
                paper="han2007",
                source="§5.2, experiment 6",
                sentence="100 ants find shorter paths than 10",
                printed="38.6223 < 45.357",
                test=Less(((Arm(MANY, "100 ants"), Arm(MANY, "10 ants")),), quantity),
                reading=reading,
            ),
            Claim(
                paper="han2007",
                source="§5.2, experiment 6",
                sentence="From 100 to 500 ants less is gained than from 10 to 100",
                printed="38.6223 to 36.237, 45.357 to 38.6223",
                test=LessGain(
                    (Arm(MANY, "100 ants"), Arm(MANY, "500 ants")),
                    (Arm(MANY, "10 ants"), Arm(MANY, "100 ants")),
                    quantity,
                ),
                reading=reading,
            ),
            Claim(
                paper="han2007",
                source="§5.2, experiment 6",
                sentence="500 ants are no better than 100 by more than the printed difference",
                printed="38.6223, 36.237",
                test=Less(((Arm(MANY, "100 ants"), Arm(MANY, "500 ants")),), quantity, margin=2.3853, strict=False),
                reading=reading,
                remark="the margin is the printed difference",
            ),
        )
    ),
    Claim(
        paper="han2007",
        source="§5.2, experiments 1 and 2",
        sentence="Without an elite the best path of an iteration varies less towards the end",
        printed="figure 5.2.2",
        test=Less(((Arm(EMPTY, "500 ants"), Arm(EMPTY, "500 ants")),), "unrest", against="early_unrest"),
        remark=f"first against last: {LAST_TEN}",
    ),
    *(
        Claim(
            paper="han2007",
            source=source,
            sentence=f"With an elite more of the pheromone lies on the best path: {words}",
            printed=f"figures {figures}",
            test=Less(((Arm(place, "500 ants"), Arm(place, "500 ants, elite")),), "concentration"),
            remark=ELITE_100,
        )
        for source, words, figures, place in (
            ("§5.2, experiments 1 and 2", "without obstacles", "5.2.4 and 5.2.8", EMPTY),
            ("§5.2, experiments 3 and 4", "with one obstacle", "5.2.10 and 5.2.11", SMALL),
        )
    ),
    Claim(
        paper="han2007",
        source="§6.0",
        sentence="With an elite ants find a path more easily: in fewer ant steps",
        printed="–",
        test=Less(((Arm(MANY, "100 ants, elite"), Arm(MANY, "100 ants")),), "effort"),
        remark=f"{CLOSE_OURS}; {ELITE_100}",
    ),
    *(
        Claim(
            paper="han2007",
            source="§5.1, experiment 4",
            sentence=f"The genetic algorithm finds shorter paths with three via points than with {words}",
            printed="33.1798 with three, the best",
            test=Less(((Arm(ONE, "3 via points"), Arm(ONE, rival)),), "length"),
            remark="one via point suffices: the shortest line around one disc touches it from one side",
        )
        for words, rival in (("one", "1 via point"), ("two", "2 via points"))
    ),
    Claim(
        paper="han2007",
        source="§5.1, experiment 4",
        sentence="More via points need more generations to converge",
        printed="–",
        test=Less(((Arm(ONE, "1 via point"), Arm(ONE, "3 via points")),), "settled"),
    ),
    *(
        Claim(
            paper="han2007",
            source="§5.1, experiment 5",
            sentence=f"Elitism gives shorter paths at the end of the genetic algorithm: {setting}",
            printed=f"figure {figure}",
            test=Less(((_genes(setting), _genes(f"{setting}, no elite")),), "last"),
        )
        for setting, figure in (("Pc 0.25, Pm 0", "5.1.9"), ("Pc 0, Pm 0.2", "5.1.10"))
    ),
    *(
        Claim(
            paper="han2007",
            source="§5.1, experiment 5",
            sentence=f"Elitism gives stabler results: {setting}",
            printed=f"figure {figure}",
            test=Wider((_genes(f"{setting}, no elite"), _genes(setting)), "last"),
        )
        for setting, figure in (("Pc 0.25, Pm 0", "5.1.9"), ("Pc 0, Pm 0.2", "5.1.10"))
    ),
    Claim(
        paper="han2007",
        source="§5.1, experiment 5",
        sentence="With elitism the crossover rate has little influence: 0 to 0.5 gains less than a mutation rate of 0 to 0.8",
        printed="figures 5.1.9 and 5.1.10",
        test=LessGain(
            (_genes("Pc 0, Pm 0"), _genes("Pc 0.5, Pm 0")), (_genes("Pc 0, Pm 0"), _genes("Pc 0, Pm 0.8")), "last"
        ),
        remark="the ends of the thesis' ranges",
    ),
    Claim(
        paper="han2007",
        source="§5.1, experiment 5",
        sentence="With elitism a higher mutation rate gives shorter paths: 0.8 shorter ones than 0.2",
        printed="figure 5.1.10",
        test=Less(((_genes("Pc 0, Pm 0.8"), _genes("Pc 0, Pm 0.2")),), "last"),
    ),
    Claim(
        paper="han2007",
        source="§5.1, experiment 5",
        sentence="Without elitism it does not",
        printed="figure 5.1.10",
        test=Less(((_genes("Pc 0, Pm 0.2, no elite"), _genes("Pc 0, Pm 0.8, no elite")),), "last", strict=False),
    ),
    Claim(
        paper="han2007",
        source="§6.0",
        sentence="The genetic algorithm's paths are shorter than the ants'",
        printed="–",
        test=Less(((Arm(MANY, "4 via points"), Arm(MANY, "500 ants")),), "length"),
        remark="judged by the run's best of both",
    ),
    *(
        Claim(
            paper="han2007",
            source="§5.2, experiment 5",
            sentence="With too few via points the genetic algorithm may fail to find a path",
            printed="–",
            test=MayFail((Arm(place, "1 via point"),)),
            reading=reading,
            remark="one via point, 20 000 random chromosomes; their number is ours",
        )
        for reading, place in (("the fourteen obstacles", MANY), ("two walls that need two bends, our map", WALLS))
    ),
)

SIZES = ("10×10", "20×20", "30×30", "50×50")
TENTH_OURS = "margin ours: 10 of the 100 iterations"


def _suganthi(reading: str, ants: str, improved: str) -> tuple[Claim, ...]:
    """The claims of Table 2 on one reading."""
    printed = ("13.899, 13.899", "28.627, 28.627", "42.184, 46.527", "94.326, 96.125")

    def claim(sentence: str, printed: str, test: Less | NoWorse | Oftener | Within | Arrive, remark: str = "") -> Claim:
        return Claim(
            paper="suganthi2019",
            source="§V, Table 2",
            sentence=sentence,
            printed=printed,
            test=test,
            reading=reading,
            remark=remark,
        )

    return (
        *(
            claim(
                f"At {size} IACO's path is no longer than ACO's",
                lengths,
                NoWorse(pairs_on((size,), improved, ants)),
                MARGIN_OURS,
            )
            for size, lengths in zip(SIZES, printed, strict=True)
        ),
        *(
            claim(f"At {size} IACO's path is shorter than ACO's", lengths, Oftener(pairs_on((size,), improved, ants)))
            for size, lengths in zip(SIZES[2:], printed[2:], strict=True)
        ),
        *(
            claim(
                f"At {size} IACO finds the shortest path",
                lengths.split(",")[0],
                Within(arms_on((size,), improved), 0.0),
            )
            for size, lengths in zip(SIZES[:2], printed[:2], strict=True)
        ),
        claim(
            "At 50×50 IACO finds a path within 100 iterations",
            "94.326",
            Arrive(arms_on(SIZES[3:], improved), least=0.9),
            "threshold ours: nine runs of ten",
        ),
    )


def _suganthi_none(reading: str, ants: str) -> Claim:
    return Claim(
        paper="suganthi2019",
        source="§V",
        sentence="At 50×50 ACO finds no path within 100 iterations",
        printed="none by the text, 96.125 by Table 2",
        test=Arrive(arms_on(SIZES[3:], ants), most=0.1),
        reading=reading,
        remark="text and table contradict each other; threshold ours: one run of ten",
    )


def _suganthi_speed(reading: str, improved: str) -> tuple[Claim, ...]:
    return (
        *(
            Claim(
                paper="suganthi2019",
                source="§V, Fig. 6",
                sentence=f"At {size} IACO converges about as fast as ACO: at most 10 iterations later",
                printed="figure 6",
                test=Less(pairs_on((size,), improved, "as"), "near", margin=10.0, strict=False),
                reading=reading,
                remark=f"{TENTH_OURS}; {NEAR_OURS}",
            )
            for size in SIZES[:2]
        ),
        *(
            Claim(
                paper="suganthi2019",
                source="§V, Fig. 6",
                sentence=f"At {size} IACO converges in fewer iterations than ACO",
                printed="figure 6",
                test=Oftener(pairs_on((size,), improved, "as"), "near"),
                reading=reading,
                remark=NEAR_OURS,
            )
            for size in SIZES[2:]
        ),
    )


DYING = "ants die in dead ends, loops stay"

SUGANTHI2019 = (
    *_suganthi("ours", "as", "iaco"),
    *_suganthi("a = 25", "as", "iaco, a = 25"),
    *_suganthi("exploratory ants deposit, too", "as", "iaco, all deposit"),
    *_suganthi(DYING, "as, ants die", "iaco, ants die"),
    _suganthi_none("ours", "as"),
    _suganthi_none(DYING, "as, ants die"),
    *_suganthi_speed("ours", "iaco"),
    *_suganthi_speed("a = 25", "iaco, a = 25"),
    *(
        Claim(
            paper="suganthi2019",
            source="§V, Table 2",
            sentence=f"At {size} {name} finds the shortest path",
            printed=length,
            test=Within(arms_on((size,), arm), 0.0),
        )
        for size, length, name, arm in (
            ("10×10", "13.899", "ACO", "as"),
            ("20×20", "28.627", "ACO", "as"),
            ("10×10", "13.899", "PFACO", "pfaco"),
        )
    ),
    *(
        claim
        for size, lengths in zip(SIZES[1:], ("38.627 > 28.627", "59.355 > 42.184", "109.761 > 94.326"), strict=True)
        for claim in (
            Claim(
                paper="suganthi2019",
                source="Table 2",
                sentence=f"At {size} PFACO's path is longer than IACO's",
                printed=lengths,
                test=Oftener(pairs_on((size,), "iaco", "pfaco")),
                remark="no path over square cells is 109.761 long" if size == SIZES[3] else "",
            ),
            Claim(
                paper="suganthi2019",
                source="§V",
                sentence=f"PFACO is not stable: at {size} its lengths scatter more than IACO's",
                printed="–",
                test=Wider((Arm(size, "pfaco"), Arm(size, "iaco"))),
            ),
        )
    ),
)

SQUARES = ("10×10, 5 obstacles", "20×20, 10 obstacles", "30×30, 15 obstacles", "40×40, 20 obstacles")
IBRAHEEM_PRINTED = ("15.07, 15.07", "28.6274, 28.6274", "45.1127, 45.9411", "61.8406, 62.6690")
IBRAHEEM_SECONDS = ("1.154530, 1.217323", "7.838582, 9.072979", "52.017160, 52.853641", "132.678247, 134.770856")


def _named(maps: tuple[str, ...]) -> list[tuple[str, str]]:
    """Maps with their sizes as words."""
    return [(name, name.split(",")[0]) for name in maps]


IBRAHEEM2016 = (
    *(
        Claim(
            paper="ibraheem2016",
            source="Table 2",
            sentence=f"At {size} MACO's path is no longer than ACO's",
            printed=lengths,
            test=NoWorse(pairs_on((name,), "maco", "as")),
            remark=MARGIN_OURS,
        )
        for (name, size), lengths in zip(_named(SQUARES), IBRAHEEM_PRINTED, strict=True)
    ),
    *(
        Claim(
            paper="ibraheem2016",
            source="Table 2",
            sentence=f"At {size} MACO's path is shorter than ACO's",
            printed=lengths,
            test=Oftener(pairs_on((name,), "maco", "as")),
        )
        for (name, size), lengths in zip(_named(SQUARES[2:]), IBRAHEEM_PRINTED[2:], strict=True)
    ),
    *(
        Claim(
            paper="ibraheem2016",
            source="§7.2.2",
            sentence=f"At {size} MACO reaches its best path in fewer iterations than ACO",
            printed=iterations,
            test=Less(pairs_on((name,), "maco", "as"), "settled"),
        )
        for (name, size), iterations in zip(_named(SQUARES), ("58 < 78", "31 < 79", "92 < 97", "96 = 96"), strict=True)
    ),
    *(
        Claim(
            paper="ibraheem2016",
            source="§7.2.2, Table 2",
            sentence=f"At {size} MACO takes less time than ACO for its 100 iterations",
            printed=f"{seconds} s",
            test=Less(pairs_on((name,), "maco", "as"), "work"),
            remark="judged by ant steps, of which the time is made",
        )
        for (name, size), seconds in zip(_named(SQUARES), IBRAHEEM_SECONDS, strict=True)
    ),
    *(
        Claim(
            paper="ibraheem2016",
            source="§7.1, Table 2",
            sentence=f"At {size} ACO finds the shortest path",
            printed=length,
            test=Within(arms_on((name,), "as"), 0.0),
        )
        for (name, size), length in zip(_named(SQUARES[:2]), ("15.07", "28.6274"), strict=True)
    ),
    *(
        claim
        for (name, size), enough in zip(_named(SQUARES[:2]), (20, 40), strict=True)
        for claim in (
            Claim(
                paper="ibraheem2016",
                source="§7.1, Fig. 8",
                sentence=f"At {size} {enough} ants are enough: 50 find no shorter path",
                printed="figure 8",
                test=NoWorse(pairs_on((name,), f"as, {enough} ants", "as")),
                remark=MARGIN_OURS,
            ),
            Claim(
                paper="ibraheem2016",
                source="§7.1, Fig. 8",
                sentence=f"At {size} {enough} ants find shorter paths than 5",
                printed="figure 8",
                test=Oftener(pairs_on((name,), f"as, {enough} ants", "as, 5 ants")),
            ),
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
            remark="rho outside is ours",
        )
        for inside, outside, reading in (("as", "0.1", "0.3 against 0.1"), ("as, rho 0.7", "0.9", "0.7 against 0.9"))
    ),
)

LEE = ("1: 25×25", "2: 50×44", "3: 100×100", "4: 100×100", "5: 100×100")
LEE_LENGTHS = (
    *("59.2548 < 72.0833", "64.0833 < 83.3970", "123.6102 < 154.2376", "135.8234 < 175.2376"),
    "131.6812 < 168.6518",
)
LEE_SECONDS = ("602 < 13326", "274 < 3926", "1063 < 16552", "1201 < 17953", "1593 < 22641")
LEE_WORK = "equal ant steps, in proportion to the printed times; their number is ours"
BACK, LETTER = "all ants step back out of dead ends", "U_j attracts, and ants return to cells"
CUT = "all ants step back, tours are cut short"
NO_LIST = "every ant of ACO deposits, by eq. 2-4"


def _lee_shorter(reading: str, ants: str, improved: str, first: int = 0) -> tuple[Claim, ...]:
    return tuple(
        Claim(
            paper="lee2008",
            source="Tables I and II",
            sentence=f"On map {name[0]} PFACO's path is shorter than ACO's",
            printed=printed,
            test=Less(pairs_on((name,), improved, ants)),
            reading=reading,
            remark=LEE_WORK,
        )
        for name, printed in zip(LEE[first:], LEE_LENGTHS[first:], strict=True)
    )


def _lee_faster(reading: str, ants: str, improved: str) -> tuple[Claim, ...]:
    return tuple(
        Claim(
            paper="lee2008",
            source="Tables I and II",
            sentence=f"On map {name[0]} PFACO is faster: fewer ant steps than ACO to a path within 25 %",
            printed=f"{seconds} s",
            test=Oftener(pairs_on((name,), improved, ants), "effort"),
            reading=reading,
            remark=f"{CLOSE_OURS}; equal where neither gets there",
        )
        for name, seconds in zip(LEE, LEE_SECONDS, strict=True)
    )


LEE2008 = (
    *_lee_shorter("ours", "as", "pfaco"),
    *_lee_faster("ours", "as", "pfaco"),
    *_lee_shorter(BACK, "as, stepping back", "pfaco, stepping back"),
    *_lee_faster(BACK, "as, stepping back", "pfaco, stepping back"),
    *_lee_shorter(CUT, "as, cut short", "pfaco, cut short"),
    *_lee_faster(CUT, "as, cut short", "pfaco, cut short"),
    *_lee_shorter(NO_LIST, "as, no list", "pfaco"),
    *_lee_shorter(LETTER, "as", "pfaco, to the letter"),
    *(
        Claim(
            paper="lee2008",
            source="Tables I and II",
            sentence="On map 1 PFACO's path is shorter than ACO's with a tenth of the ant steps",
            printed=LEE_LENGTHS[0],
            test=Less(pairs_on(LEE[:1], f"pfaco{how}, a tenth", f"as{how}, a tenth")),
            reading=reading,
            remark="equal ant steps",
        )
        for reading, how in (("ours", ""), (BACK, ", stepping back"))
    ),
    *(
        Claim(
            paper="lee2008",
            source="Tables I and II",
            sentence="On map 3 PFACO's path is shorter than that of an ACO with ten times the ant steps",
            printed=f"{LEE_LENGTHS[2]}, {LEE_SECONDS[2]} s",
            test=Less(pairs_on(LEE[2:3], f"pfaco{how}", f"as{how}, ten times")),
            reading=reading,
        )
        for reading, how in (("ours", ""), (BACK, ", stepping back"))
    ),
    *(
        Claim(
            paper="lee2008",
            source="§V",
            sentence="On the maps of 100×100 cells PFACO's paths are acceptable: within 15 % of the shortest",
            printed="123.6102, 135.8234, 131.6812",
            test=Within(arms_on(LEE[2:], name), 15.0),
            reading=reading,
            remark="margin ours: 15 %",
        )
        for reading, name in (("ours", "pfaco"), (BACK, "pfaco, stepping back"), (LETTER, "pfaco, to the letter"))
    ),
)

CASES = (
    *("1a curved walls", "2b overlapping curved walls", "3c vertical rows"),
    *("4d concentric circles", "5e many shapes", "5f the same, across the wall"),
)
HASAN_COSTS = "lower in 5, equal in 3c"
HASAN_SECONDS = "2.96 to 5.64 s, 3.49 to 32.89 s"
OPTIMAL, FIRST_TOUCH, RULE = "D* is optimal", "D* lowers no cost", "our rule for alpha and beta"
MOVING = "a moving obstacle"


def _hasan_cost(ants: str, rival: str, reading: str, sentence: str) -> Claim:
    return Claim(
        paper="hasan",
        source="Table 1",
        sentence=sentence,
        printed=HASAN_COSTS,
        test=Cases(pairs_on(CASES, ants, rival), "total", 5),
        reading=reading,
    )


def _hasan_time(ants: str, rival: str, sentence: str, best_run: bool) -> Claim:
    return Claim(
        paper="hasan",
        source="Table 1",
        sentence=sentence,
        printed=HASAN_SECONDS,
        test=Cases(pairs_on(CASES, ants, rival), "cpu_ms", 6, best_run),
        reading=OPTIMAL,
        remark=f"processor time [ms], both compiled, {'least' if best_run else 'median'} of the runs",
    )


STILL = "The total path cost is below that of D* in at least five of the six environments"
AMONG = f"{STILL}, with {MOVING}"

HASAN = (
    _hasan_cost("mmas-dstar", "dstar", OPTIMAL, STILL),
    _hasan_cost("mmas-dstar", "D* that lowers no cost", FIRST_TOUCH, STILL),
    _hasan_cost("mmas-dstar, our rule", "dstar", f"{OPTIMAL}, {RULE}", STILL),
    _hasan_cost("mmas-dstar, our rule", "D* that lowers no cost", f"{FIRST_TOUCH}, {RULE}", STILL),
    _hasan_cost("mmas-dstar, moving", "dstar, moving", OPTIMAL, AMONG),
    _hasan_cost("mmas-dstar, moving", "D* that lowers no cost, moving", FIRST_TOUCH, AMONG),
    _hasan_time("mmas-dstar", "dstar", "It is faster than D* in all six environments", True),
    _hasan_time(
        "mmas-dstar, moving", "dstar, moving", f"It is faster than D* in all six environments, with {MOVING}", False
    ),
    Claim(
        paper="hasan",
        source="Table 1",
        sentence="It is faster than D* in all six environments: fewer cells get pheromone than D* costs",
        printed=HASAN_SECONDS,
        test=Cases(pairs_on(CASES, "mmas-dstar", "D* that lowers no cost"), "work", 6),
        reading=FIRST_TOUCH,
        remark="cells that get a value; this D* is not compiled, so that times do not compare",
    ),
    Claim(
        paper="hasan",
        source="abstract, Fig. 4",
        sentence="The robot reaches its goal without colliding with the moving obstacle",
        printed="–",
        test=Arrive(arms_on(CASES, "mmas-dstar, moving"), least=0.9),
        remark="threshold ours: nine runs of ten",
    ),
)

#: All claims, in the order of the papers.
CLAIMS: tuple[Claim, ...] = (*HAN2007, *SUGANTHI2019, *IBRAHEEM2016, *LEE2008, *HASAN)
