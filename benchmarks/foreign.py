"""Proofs of degraded logs beside the truth: `python -m benchmarks.foreign [--drives N] [--jobs N] [--seed S] [TABLE ...]`.

Tables:

- bounds: how far the bound falls below that of our own log, by degradation and rate
- touches: degraded logs of drives that touched something
- files: degraded logs written as bags and tables and read back; clocks that jump
- long: time and memory to read a long bag

Drive n follows from n and the seed. Some are driven again, command by command, beside a cylinder that their line just overlaps
or just misses; half of those among movers drive as if there were none. Drives are kept in a folder, so that another call
only degrades them.
"""

from __future__ import annotations

import collections
import dataclasses
import itertools
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from antdrive.base.errors import FieldError
from antdrive.base.types import Floats, Ints
from antdrive.foreign.certificate import ForeignCertificate
from antdrive.foreign.log import ForeignLog, read_log
from antdrive.proof import Track, prove
from antdrive.proof.distances import to_discs
from antdrive.robots import Footprint, Twist, list_robots, load_robot
from antdrive.sim import Engine, Outcome, Rollout, Scenario, run
from antdrive.sim.driving.parts import Ending
from antdrive.sim.driving.plants import Bullet
from antdrive.worlds import Disc, Task, Trajectories, World, generate, list_worlds, load_task
from benchmarks.drives import barn_tasks
from benchmarks.dynamic import random_task
from benchmarks.markdown import call_all, command_line, print_tables, table
from tests.foreign.writing import write_bag
from tools.loop import loop
from tools.shared_data import BARN

SMALLEST = ("--drives 2 --jobs 1 --minutes 0.05",)
STREAM = 0x464F5247  # keeps these drives apart from those of all other seeds
HZ, TIME = 240, 30.0  # rate of the rows [Hz]; limit of a drive [s]
KINDS = ("catalogue", "forest", "barn", "forest", "movers", "catalogue", "forest", "barn", "hall", "thicket")
GRAZED, ALONE = 0.3, 0.5  # shares of drives beside a grazing cylinder, and among movers without avoidance
RATES = (10, 20, 30, 50)  # of degraded logs [Hz]
UNEVEN, LOST, YAW = 0.3, 0.05, 0.01  # jitter in intervals, share of rows lost, deviation of headings [rad]
DRIFT, DRIFT_YAW, BETWEEN = 0.05, 0.02, (0.5, 1.5)  # of a localisation [m], [rad]; time between its corrections [s]
BLENDED = 0.8  # share of the drift at most, since tf2 interpolates between transforms before and after a correction
JUMP, BAGS = 5.0, ("mcap", "sqlite3", "ros1")  # of a clock [s]; storages of bags
SAME = 1e-6  # poses and times read back agree to this, and bounds with the truth [m], [rad], [s]


class Drive(NamedTuple):
    """The essentials of a drive, and the truth about it."""

    about: str  # world, robot and the rest
    robot: str  # the robot's name
    bounds: Floats  # the world's [m]
    discs: Floats  # the world's cylinders (N, 3) [m]
    radii: Floats  # the movers' (M,) [m]
    pose: Floats  # the robot's at 240 Hz (T, 3)
    movers: Floats  # their positions (T, M, 2) [m]
    travelled: Floats  # how far they have come (T, M) [m]
    jumped: Floats  # how often they have jumped (T, M)
    contact: int  # the first row with a contact in physics; T: none
    apart: Floats = np.zeros(0)  # distances to the nearest obstacle or mover (T,) [m]
    ours: float = 0.0  # the bound of our own log [m]

    @property
    def touched(self) -> bool:
        """Whether physics or the closed form finds a contact."""
        return bool(self.contact < len(self.pose) or self.apart.min() <= 0)

    @property
    def world(self) -> World:
        """The world without movers."""
        xmin, ymin, xmax, ymax = self.bounds.tolist()
        return World("driven", (xmin, ymin, xmax, ymax), tuple(Disc(*disc) for disc in self.discs.tolist()))

    def others(self, rows: Ints) -> list[Track]:
        """Return the tracks of the movers at some rows."""
        travel, jumps = np.diff(self.travelled[rows], axis=0), np.diff(self.jumped[rows], axis=0) > 0
        still = np.zeros((len(rows), 1))
        return [
            Track(rows / HZ, np.hstack([xy, still]), Footprint.disc(radius), travel[:, m], jumps[:, m])
            for m, (xy, radius) in enumerate(zip(self.movers[rows].swapaxes(0, 1), self.radii.tolist(), strict=True))
        ]


def task_of(kind: str, robot: str, rng: np.random.Generator) -> Task:
    """Draw a world of a kind, of the random ones one that a robot can cross."""
    if kind == "hall":
        return random_task(int(rng.integers(2**31)))[0]
    if kind == "barn" and BARN.exists():
        return list(barn_tasks(BARN).values())[rng.integers(50)]
    if kind in ("catalogue", "movers"):
        names = [name for name in list_worlds() if (kind == "movers") == ("moving" in name or "people" in name)]
        return load_task(str(rng.choice(names)))
    room = {"robot_radius": f"{load_robot(robot).radius + rng.uniform(0.05, 0.15):.3f}"}
    thicket = {"count": f"{rng.integers(20, 61)}", "radius": "0.05,0.4", "clearance": "0.9"}
    return generate("forest", rng, room | (thicket if kind == "thicket" else {"count": f"{rng.integers(4, 11)}"}))


def driven(n: int, seed: int) -> Drive:
    """Drive n: the first settings that have a path."""
    for attempt in itertools.count():
        rng, kind = np.random.default_rng([STREAM, seed, n, attempt]), KINDS[n % len(KINDS)]
        robot, planner = str(rng.choice(list(list_robots()))), str(rng.choice(["astar", "ants"]))
        given: dict[str, Any] = {"noise": float(rng.integers(2)), "margin": float(rng.uniform(0, 0.1))}
        if kind in ("movers", "hall") and rng.random() < ALONE:
            given |= {"avoidance": None, "replanning": None}
        try:
            s = Scenario.of(task_of(kind, robot, rng), planner, robot, seed=n, time_limit=TIME, **given)
        except FieldError:  # no room for the robot
            continue
        log, world = run(s).rollout, s.task.world
        if log is None or len(log.t) < HZ:
            continue
        about = f"drive {n}: {world.name}, {robot}, {planner}, noise {given['noise']:g}, margin {given['margin']:.3f}"
        if not world.movers and not len(log.contacts) and rng.random() < GRAZED:
            return grazed(f"{about}, grazed", s, log, rng)
        return essentials(about, s, world, log.pose, log.twist, log.contacts)
    raise AssertionError


def grazed(about: str, s: Scenario, log: Rollout, rng: np.random.Generator) -> Drive:
    """Repeat a drive's commands beside a cylinder that its line overlaps by some millimetres, or just misses."""
    pose, radius, overlap = log.pose, float(rng.uniform(0.03, 0.2)), rng.exponential(0.004) - 0.001
    row = int(rng.integers(len(pose) // 4, len(pose)))
    toward = np.exp(1j * (pose[row, 2] + rng.uniform(-1.7, 1.7)))
    near, far = 0.0, s.robot.radius + radius + 1.0
    for _ in range(40):
        away = (near + far) / 2
        x, y = pose[row, 0] + away * toward.real, pose[row, 1] + away * toward.imag
        least = to_discs(s.robot.footprint, pose, np.array([[[x, y]]]), np.array(radius)).min()
        near, far = (away, far) if least < -overlap else (near, away)
    world = dataclasses.replace(s.task.world, obstacles=(*s.task.world.obstacles, Disc(float(x), float(y), radius)))
    targets = log.actuated if len(log.actuated) else log.command
    with Engine(world, s.robot, physics_hz=HZ) as engine:
        plant = Bullet(engine, s.task.start, s.control_hz)
        for target in targets[1 :: plant.per_tick].tolist():
            plant.advance(Twist(*target), Twist(*target))
        again = plant.finish(Ending(Outcome.STOPPED))
    return essentials(about, s, world, again.pose, again.twist, again.contacts)


def essentials(about: str, s: Scenario, world: World, pose: Floats, twist: Floats, contacts: Floats) -> Drive:
    """Return the essentials of a log, with our own proof."""
    t, paths = np.arange(len(pose)) / HZ, Trajectories.of(world, s.task.start[:2], s.seed)
    sums = (np.vstack([np.zeros(len(paths)), np.cumsum(part, axis=0)]) for part in (paths.travel(t), paths.jumps(t)))
    places = (np.array(world.bounds), world.discs, paths.radii, pose, paths.positions(t))
    drive = Drive(about, s.robot.name, *places, *sums, int(contacts[0, 0]) if len(contacts) else len(pose))
    robot = Track.measured(t, pose, twist, s.robot.footprint)
    proof = prove(robot, drive.world, drive.others(np.arange(len(pose))))
    return drive._replace(apart=proof.clearance, ours=proof.bound)


class Degraded(NamedTuple):
    """A drive as another program would log it."""

    rows: Ints  # rows of our log (K,)
    pose: Floats  # (K, 3)
    error: float = 0.0  # that is stated [m]
    corrected: tuple[tuple[float, tuple[float, float, float]], ...] = ()  # times and new poses of the frame odom
    jump: float = 0.0  # of the clock, half-way [s]


def sampled(drive: Drive, hz: float, rng: np.random.Generator, uneven: float = 0, lost: float = 0) -> Degraded:
    """Keep some rows, at uneven times or with some lost."""
    at = np.arange(0, len(drive.pose) - 1, HZ / hz)
    at += uneven * HZ / hz * rng.uniform(-1, 1, len(at))
    rows = np.unique(np.clip(np.rint(at), 0, len(drive.pose) - 1).astype(np.int64))
    rows = rows[rng.random(len(rows)) >= lost]
    return Degraded(rows, drive.pose[rows])


def noisy(drive: Drive, hz: float, rng: np.random.Generator, sigma: float) -> Degraded:
    """Add normal errors to the poses, truncated at three standard deviations [m]."""
    log = sampled(drive, hz, rng)
    off = rng.normal(0, (sigma, sigma, YAW), (len(log.rows), 3))
    off[:, :2] *= np.minimum(1, 3 * sigma / np.hypot(off[:, 0], off[:, 1]))[:, None]
    off[:, 2] = np.clip(off[:, 2], -3 * YAW, 3 * YAW)
    return log._replace(pose=log.pose + off, error=3 * sigma + 3 * YAW * load_robot(drive.robot).radius)


def drifting(drive: Drive, hz: float, rng: np.random.Generator) -> Degraded:
    """Let the poses drift, and correct them about once a second in a jump, as AMCL does."""
    log, corrected, odom = sampled(drive, hz, rng), [], np.zeros(2)
    off, last = np.zeros((len(log.rows), 3)), np.zeros(3)
    gaps = np.cumsum(rng.uniform(*BETWEEN, 1 + round(len(drive.pose) / HZ / BETWEEN[0])))
    ends = np.searchsorted(log.rows / HZ, gaps[gaps < log.rows[-1] / HZ]).tolist()
    for begin, end in itertools.pairwise([0, *ends, len(log.rows)]):
        angle, share = rng.uniform(0, 2 * np.pi, 2), np.linspace(0, 1, end - begin)[:, None]
        xy = DRIFT * BLENDED * np.sqrt(rng.random(2)) * np.array([np.cos(angle), np.sin(angle)])
        knots = np.column_stack([xy.T, rng.uniform(-DRIFT_YAW, DRIFT_YAW, 2)])
        off[begin:end] = (1 - share) * knots[0] + share * knots[1]
        odom, last = odom + off[begin, :2] - last[:2], off[end - 1]
        corrected.append((float(log.rows[begin] / HZ), (float(odom[0]), float(odom[1]), 0.0)))
    error = DRIFT + DRIFT_YAW * load_robot(drive.robot).radius
    return log._replace(pose=log.pose + off, error=error, corrected=tuple(corrected))


DEGRADATIONS: Mapping[str, Callable[[Drive, float, np.random.Generator], Degraded]] = {
    "none": sampled,
    f"intervals uneven by ±{100 * UNEVEN:g} %": partial(sampled, uneven=UNEVEN),
    f"{100 * LOST:g} % of rows lost": partial(sampled, lost=LOST),
    "noise, σ 1 cm": partial(noisy, sigma=0.01),
    "noise, σ 3 cm": partial(noisy, sigma=0.03),
    "drift up to 5 cm, corrected": drifting,
}


def written(path: Path, log: Degraded, storage: str) -> Path:
    """Write a log as a bag of Nav2 in a storage, as a TUM trajectory or as a CSV table."""
    t, (x, y, yaw) = log.rows / HZ, log.pose.T
    stamps, zero = t + np.where(t > t[len(t) // 2], log.jump, 0.0), np.zeros(len(t))
    if storage == "csv":
        np.savetxt(path, np.column_stack([stamps, x, y, yaw]), "%.9f", ",", header="t,x,y,yaw", comments="")
    elif storage == "tum":
        np.savetxt(path, np.column_stack([stamps, x, y, *[zero] * 3, np.sin(yaw / 2), np.cos(yaw / 2)]), "%.9f")
    else:
        return Path(write_bag(path, t, log.pose, storage=storage, stamps=stamps, corrected=log.corrected))
    return path


class Judged(NamedTuple):
    """The proof of a degraded log, beside the truth."""

    drive: str  # the drive
    touched: bool  # whether it touched something
    ours: float  # the bound of our own log [m]
    degradation: str
    hz: int  # its rate
    storage: str  # how it was read; memory: not from a file
    error: float  # that is stated [m]
    bound: float  # of the degraded log [m]
    proved: bool  # whether it says that nothing was touched
    wrong: float  # by how much a bound between rows exceeds truth and error at most, before a contact [m]; negative: nowhere
    same: bool = True  # whether rows read back are those that were written


def judged(drive: Drive, log: Degraded, *about: Any, read: ForeignLog | None = None) -> Judged:
    """Certify a degraded log, as it is or as it was read, and compare the bound with the truth at each of our rows."""
    t, robot, error = log.rows / HZ, load_robot(drive.robot), log.error
    foreign = read or ForeignLog(t, log.pose, 0.0, (), np.zeros(len(t) - 1, dtype=bool), {})
    foreign = dataclasses.replace(foreign, t=foreign.t - foreign.t[0] + t[0])
    timed = len(foreign.t) == len(t) and float(np.abs(foreign.t - t).max()) < SAME
    same = timed and float(np.abs(np.exp(1j * (foreign.pose - log.pose)) - 1).max()) < SAME
    proof = ForeignCertificate(foreign, drive.world, (0.0, 0.0, 0.0), robot, pose_error=error)
    if timed and len(drive.radii):
        rows = np.arange(log.rows[0], log.rows[-1] + 1)
        track = Track.limited(t, foreign.pose, robot, at=rows / HZ, unknown=foreign.unknown, error=error)
        proved = prove(track, drive.world, drive.others(rows))
        vars(proof).update(tracks=(track,), proof=proved)
    steps, rows = proof.tracks[0].t, np.arange(log.rows[0], log.rows[log.rows <= drive.contact].max(initial=0) + 1)
    between = proof.proof.between[np.clip(np.searchsorted(steps, rows / HZ, "right") - 1, 0, len(steps) - 2)]
    wrong = float((between - error - drive.apart[rows]).max(initial=-np.inf)) if timed else -np.inf
    return Judged(
        drive.about, drive.touched, drive.ours, *about, error, proof.proof.bound, proof.certified, wrong, same
    )


def results(n: int, seed: int, folder: Path) -> list[Judged]:
    """Drive n, or load it, and judge its degraded logs: all from memory, one of them and a clock's jump from a file."""
    path = folder / f"{seed}-{n}.npz"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(path, **driven(n, seed)._asdict())
    with np.load(path) as file:
        drive = Drive(*(file[key] if file[key].ndim else file[key].item() for key in Drive._fields))
    rng, found = np.random.default_rng([STREAM, seed, n]), list[Judged]()
    cases = list(itertools.product(DEGRADATIONS, RATES))
    logs = [DEGRADATIONS[name](drive, hz, rng) for name, hz in cases]
    found += [judged(drive, log, *case, "memory") for case, log in zip(cases, logs, strict=True)]
    one = int(rng.integers(len(cases)))
    jump = sampled(drive, 30, rng)._replace(jump=float(rng.choice([-JUMP, JUMP])))
    for case, log in ((cases[one], logs[one]), ((f"clock jumps by {jump.jump:+g} s", 30), jump)):
        storage = str(
            rng.choice(BAGS if len(drive.radii) else [*BAGS, "tum", "csv"])
        )  # tables lose the time that jumps
        with tempfile.TemporaryDirectory() as place:
            read = read_log(written(Path(place) / f"log.{storage}", log, storage))
        found.append(judged(drive, log, *case, storage, read=read))
    return found


def counts(logs: Iterable[Judged]) -> list[str]:
    """Return how many logs there are, have a bound above the truth somewhere, and are proved."""
    logs = list(logs)
    return [str(len(logs)), str(sum(j.wrong > SAME for j in logs)), str(sum(j.proved for j in logs))]


def bounds(found: Sequence[Judged], minutes: float) -> Iterator[str]:
    """Compare the bounds of drives that touched nothing."""
    clear, rows = [j for j in found if not j.touched and j.storage == "memory"], []
    for name, hz in itertools.product(DEGRADATIONS, RATES):
        some = [j for j in clear if (j.degradation, j.hz) == (name, hz)]
        falls, stated = [100 * (j.ours - j.bound) for j in some] or [np.nan], [100 * j.error for j in some] or [0.0]
        error, fall = (" / ".join(f"{np.quantile(v, q):.1f}" for q in (0.5, 0.05, 0.95)) for v in (stated, falls))
        rows.append([name, str(hz), error if max(stated) else "0", fall, *counts(some)])
    heads = "degradation | Hz | stated error [cm]: median / 5 % / 95 % | our bound − foreign bound [cm]: same"
    yield from table(f"{heads} | logs | above the truth | proved", rows)


def touches(found: Sequence[Judged], minutes: float) -> Iterator[str]:
    """Count the proofs of drives that touched something."""
    some = [j for j in found if j.touched]
    kinds = {"up to 2 mm": (-0.002, 1.0), "up to 1 cm": (-0.01, -0.002), "more": (-9.0, -0.01)}
    of = {kind: [j for j in some if low < j.ours <= high] for kind, (low, high) in kinds.items()}
    rows = [[kind, str(len({j.drive for j in logs})), *counts(logs)] for kind, logs in of.items()]
    yield from table("overlap | drives | logs | above the truth before the contact | proved", rows)


def files(found: Sequence[Judged], minutes: float) -> Iterator[str]:
    """Count logs that were written and read back."""
    of = collections.defaultdict[tuple[str, str], list[Judged]](list)
    for j in found:
        if j.storage != "memory":
            of[j.degradation if "clock" in j.degradation else "one of the above", j.storage].append(j)
    rows = [[*key, str(sum(j.same for j in logs)), *counts(logs)] for key, logs in sorted(of.items())]
    yield from table("degradation | read from | same rows | logs | above the truth | proved", rows)


def long(found: Sequence[Judged], minutes: float) -> Iterator[str]:
    """Read a bag with transforms at 50 Hz and scans of two lidars at 10 Hz, each time in a fresh process."""
    rows, t = [], np.arange(0, 60 * minutes, 0.02)
    pose = np.column_stack([np.cos(t / 5), np.sin(t / 5), t / 5 + np.pi / 2])
    for storage in BAGS:
        with tempfile.TemporaryDirectory() as place:
            bag = write_bag(Path(place) / "long", t, pose, storage=storage, scan_rate=10.0)
            command = [sys.executable, "-m", "benchmarks.foreign", "--read", str(bag)]
            read, memory = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
        rows.append([storage, f"{float(read):.1f} s", f"{float(memory):.0f} MB", f"{loop():.2f} s"])
    yield from table(f"bag of {minutes:g} minutes | to read | peak memory | ten million additions", rows)


def main() -> None:
    given = command_line(
        __doc__,
        tables=([], "tables to print; default: all"),
        drives=(1000, "number of drives"),
        jobs=(int, "processes; by default one per core"),
        seed=(0, "seed of the drives"),
        folder=(Path("out/foreign"), "folder where drives are kept"),
        minutes=(10.0, "length of the long bag [min]"),
        read=(Path, "only read a bag, and print the seconds and the peak memory [MB]"),
    )
    if given.read is not None:
        start = time.perf_counter()
        read_log(given.read)
        print(time.perf_counter() - start, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
        return
    numbers = range(given.drives) if given.tables != ["long"] else ()
    calls = (partial(results, n, given.seed, given.folder) for n in numbers)
    found = [j for some in call_all(calls, given.jobs) for j in some]
    print_tables(given.tables, {f.__name__: f for f in (bounds, touches, files, long)}, found, given.minutes)
    for j in found:
        if j.wrong > SAME or (j.touched and j.proved):
            print(j)


if __name__ == "__main__":
    main()
