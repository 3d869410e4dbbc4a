"""Predicted and measured margin losses: `python -m benchmarks.margins [--worlds N] [--jobs N]`.

Every combination of robot, noise and smoothing drives random worlds, half of them forests and half of them like BARN's, with
`--margin auto`. The worlds' seeds differ from the calibration's. `--default` drives calibration courses with the default margin.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from antdrive.runs.margins.choice import RESERVE, Calibration, choose_margin, predicted_loss, with_chosen_margin
from antdrive.runs.margins.loss import loss_on_course
from antdrive.sim import Outcome, Scenario, run
from antdrive.worlds import generate
from benchmarks.markdown import call_all, command_line, print_table

SMALLEST = (
    "--worlds 2 --robots turtlebot --smoothings taut --noises 0 --jobs 1",
    "--default --worlds 18 --robots turtlebot --smoothings taut --noises 1 --jobs 1",
)
FIRST_SEED = 50_000


class Driven(NamedTuple):
    """One drive.

    Attributes:
        name: the world
        loss: the margin minus the certificate's bound [m]; nan without a drive
        outcome: how it ended
        contacts: number of contacts
        certified: whether the robot reached the goal and its log proves that nothing was touched
    """

    name: str
    loss: float
    outcome: Outcome
    contacts: int
    certified: bool


def scenario(kind: str, seed: int, robot: str, noise: float, smoothing: str) -> Scenario:
    task = generate(kind, np.random.default_rng(seed), {}, name=f"{kind} {seed}", note="")
    return Scenario.of(task, "astar", robot, noise=noise, smoothing=smoothing, seed=seed, margin=0.0)


def drive(kind: str, seed: int, robot: str, noise: float, smoothing: str, margin: float | None) -> Driven:
    """Drive a world with a margin; None: with the one that the cache holds."""
    made = scenario(kind, seed, robot, noise, smoothing)
    done = run(with_chosen_margin(made) if margin is None else replace(made, margin=margin))
    if done.rollout is None or done.certificate is None:
        return Driven(made.task.world.name, math.nan, done.outcome, 0, False)
    loss = done.scenario.margin - done.certificate.bound
    return Driven(made.task.world.name, loss, done.outcome, len(done.rollout.contacts), done.succeeded)


def row(calibration: Calibration, drives: list[Driven]) -> list[str]:
    losses = np.array([d.loss for d in drives if not math.isnan(d.loss)])
    driven = [d for d in drives if d.outcome is not Outcome.NO_PATH]

    def mm(value: float) -> str:
        return f"{1000 * value:.0f}"

    median, high = np.quantile(losses, (0.5, 0.95)) if len(losses) else (math.nan, math.nan)
    return [
        mm(calibration.margin), mm(calibration.loss), mm(calibration.largest),
        f"{mm(median)} / {mm(high)} / {mm(losses.max(initial=-math.inf))}" if len(losses) else "–",
        str(int((losses > calibration.loss).sum())), f"{len(driven)} of {len(drives)}",
        str(sum(d.contacts > 0 for d in driven)), str(sum(not d.certified for d in driven)),
    ]  # fmt: skip


def default_row(made: Scenario, courses: int, jobs: int | None) -> list[str]:
    """Return the default margin, the loss predicted at it with the reserve, and the largest loss on courses."""
    calls = [partial(loss_on_course, made.loss_factors, made.usual_margin, n) for n in range(courses)]
    footprint, disc = zip(*call_all(calls, jobs), strict=True)
    loss = min(predicted_loss(footprint), predicted_loss(disc)) + RESERVE
    return [f"{1000 * value:.0f}" for value in (made.usual_margin, loss, max(footprint))]


def main() -> None:
    arguments = command_line(
        __doc__,
        worlds=(60, "number of random worlds for each row"),
        robots=("turtlebot,jackal", "robots, separated by commas"),
        smoothings=("none,taut,clearance", "kinds of smoothing, separated by commas"),
        noises=("0,1", "levels of noise, separated by commas"),
        jobs=(int, "processes; by default one per core"),
        fixed=(float, "drive with this margin instead [m]; predictions are those of auto"),
        default=(False, "compare the default margins with as many calibration courses"),
    )
    rows, wrong = [], []
    robots, smoothings = arguments.robots.split(","), arguments.smoothings.split(",")
    noises = map(float, arguments.noises.split(","))
    rest = list(itertools.product(robots, noises, smoothings))
    if arguments.default:
        made = (scenario("forest", FIRST_SEED, *each) for each in rest)
        print_table(
            ["robot", "noise", "smoothing", "default, mm", "predicted and reserve", "largest loss"],
            (
                [s.robot.name, f"{s.noise:g}", s.smoothing, *default_row(s, arguments.worlds, arguments.jobs)]
                for s in made
            ),
        )
        return
    for robot, noise, smoothing in rest:
        calibration = choose_margin(scenario("forest", FIRST_SEED, robot, noise, smoothing).loss_factors)
        worlds = [(kind, FIRST_SEED + n) for n in range(arguments.worlds // 2) for kind in ("forest", "barn")]
        calls = [partial(drive, *world, robot, noise, smoothing, arguments.fixed) for world in worlds]
        drives = call_all(calls, arguments.jobs)
        rows.append([robot, f"{noise:g}", smoothing, *row(calibration, drives)])
        print("|", " | ".join(rows[-1]), "|", flush=True)
        wrong += [
            f"{d.name}, {robot}, noise {noise:g}, {smoothing}: {d.outcome.key}, loss {1000 * d.loss:.1f} mm"
            for d in drives
            if d.outcome is not Outcome.NO_PATH and not (d.certified and d.loss <= calibration.loss)
        ]
    heads = [
        "robot", "noise", "smoothing", "margin, mm", "predicted loss", "largest on courses", "measured: median / 95 % / largest",
        "beyond the prediction", "with a path", "with contacts", "not certified",
    ]  # fmt: skip
    print()
    print_table(heads, rows)
    print("Not certified, or beyond the prediction: " + ("; ".join(wrong) or "none."))


if __name__ == "__main__":
    main()
