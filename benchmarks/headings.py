"""Headings of outlines against samples, and their time: `python -m benchmarks.headings [--cases N]`. Prints Markdown.

Each case is a random place among ten discs, with one of nine outlines. The first table counts wrong answers. The oracle computes
distances in plain numpy: at a heading, at 151 headings of a turn, or at 61 places of a straight move. Cases are near if they
are within rounding of touching, or if the samples are too coarse to decide. The second table has processor times of the
fastest of nine calls on 160 x 360 cells of 5 cm, for the bits and the moves of all cells.
"""

from __future__ import annotations

import collections
import math
import time
from collections.abc import Iterator

import numpy as np

from antdrive.worlds import DIRECTIONS
from antdrive.worlds.headings import Outline, sweep_clearance, turn_clear
from antdrive.worlds.headings._kernels_headings import clear_moves, heading_bits
from benchmarks.markdown import command_line, print_table
from tests.worlds.headings.oracle import BAND, OUTLINES, crowd, gap, sampled

SMALLEST = ("--cases 20 --rounds 1",)
EACH, DISCS, SIDE, CELL = 50, 10, 4.0, 0.1  # cases and discs in each world, its side and cells [m]
STEP = math.pi / 4
KINDS = ("headings", "turns", "straight moves", "headings of cells", "turns of cells", "moves of cells")


def moved(outline: Outline, x: float, y: float, yaw: float, along, discs, bounds) -> tuple[float, float]:
    """Return the least gap of a straight move, from samples, and a bound on how much smaller the true one is."""
    share = np.linspace(0.0, 1.0, 61)
    least = gap(outline, x + share * along[0], y + share * along[1], yaw, discs, bounds).min()
    return float(least), math.hypot(*along) / 120


def answers(cases: int) -> Iterator[tuple[str, bool, float, float]]:
    """Yield the kind of each case, whether it is clear by the kernels, the samples' least gap, and their slack."""
    for seed in range(math.ceil(cases / EACH)):
        rng = np.random.default_rng(seed)
        discs, bounds = crowd(seed, count=DISCS, size=SIDE)
        outline = list(OUTLINES.values())[seed % len(OUTLINES)]
        count = round(SIDE / CELL)
        bits, moves = np.zeros((count, count), np.uint16), np.zeros((count, count), np.uint8)
        grid = (discs, np.array(bounds), CELL / 2, CELL / 2, CELL, outline.corners, outline.reach)
        heading_bits(*grid, bits)
        clear_moves(*grid, bits, moves)
        around = discs, bounds
        for _ in range(min(EACH, cases - seed * EACH)):
            (x, y), yaw = rng.uniform(0.2, SIDE - 0.2, 2), float(rng.uniform(0, 2 * math.pi))
            turn, along = float(rng.uniform(-math.pi, math.pi)), rng.uniform(-0.4, 0.4, 2)
            here = float(gap(outline, x, y, yaw, *around)[0])
            yield "headings", turn_clear(x, y, yaw, 0.0, outline, *around), here, 0.0
            yield (
                "turns",
                turn_clear(x, y, yaw, turn, outline, *around),
                *sampled(outline, x, y, yaw, yaw + turn, *around, 151),
            )
            swept = sweep_clearance(x, y, x + along[0], y + along[1], yaw, outline, *around)
            yield "straight moves", swept > 0, *moved(outline, x, y, yaw, along, *around)
            some = np.argwhere(bits)
            r, c = rng.integers(0, count, 2) if rng.random() < 0.3 or not len(some) else some[rng.integers(len(some))]
            k = int(rng.integers(8))
            x, y, yaw, (dr, dc) = CELL * (c + 0.5), CELL * (r + 0.5), k * STEP, DIRECTIONS[k]
            yield "headings of cells", bool(bits[r, c] >> k & 1), float(gap(outline, x, y, yaw, *around)[0]), 0.0
            least = sampled(outline, x, y, yaw, yaw + STEP, *around, 151)
            yield "turns of cells", bool(bits[r, c] >> (8 + k) & 1), *least
            yield (
                "moves of cells",
                bool(moves[r, c] >> k & 1),
                *moved(outline, x, y, yaw, (CELL * dc, CELL * dr), *around),
            )


def compare(cases: int) -> Iterator[list[str]]:
    counts: collections.Counter[tuple[str, str]] = collections.Counter()
    for kind, clear, least, slack in answers(cases):
        decided = least < -BAND or least > slack + BAND
        verdict = "near" if not decided else "wrong" if clear != (least > 0) else "clear" if clear else "blocked"
        counts[kind, verdict] += 1
    for kind in KINDS:
        yield [kind, str(cases), *(str(counts[kind, verdict]) for verdict in ("clear", "blocked", "near", "wrong"))]


def times(rounds: int) -> Iterator[list[str]]:
    bounds = np.array([0.0, 0.0, 18.0, 8.0])
    bits, moves = np.zeros((160, 360), np.uint16), np.zeros((160, 360), np.uint8)
    for count in (300, 600, 1000):
        rng = np.random.default_rng(count)
        discs = np.column_stack([rng.uniform(0, (18, 8), (count, 2)), rng.uniform(0.05, 0.1, count)])
        for name in ("rectangle", "triangle", "hexagon"):
            grid = (discs, bounds, 0.025, 0.025, 0.05, OUTLINES[name].corners, OUTLINES[name].reach)
            spent = []
            for _ in range(rounds + 1):  # the first compiles
                started = time.process_time()
                heading_bits(*grid, bits)
                between = time.process_time()
                clear_moves(*grid, bits, moves)
                spent.append((between - started, time.process_time() - between))
            both = min(spent[1:], key=sum)
            some = float((moves > 0).mean())
            yield [str(count), name, f"{100 * some:.0f} %", *(f"{1e3 * value:.1f}" for value in (*both, sum(both)))]


def main() -> None:
    chosen = command_line(__doc__, cases=(10_000, "cases of each kind"), rounds=(9, "calls that are timed"))
    print_table("question | cases | clear | blocked | near | wrong", compare(chosen.cases))
    print_table("discs | outline | cells with a move | headings [ms] | moves [ms] | both [ms]", times(chosen.rounds))


if __name__ == "__main__":
    main()
