"""Foreign certificate: what a log of another program proves, under which assumptions. It is not the certificate of a drive.

The log of a drive repeats its physics and its contacts; that of another program holds poses. So the robot's limits, the
errors of the poses and the completeness of the map are assumptions, and each is named.
"""

from __future__ import annotations

import functools
import hashlib
import math
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from antdrive.base.errors import input_error
from antdrive.base.plane import format_point, map_to_world, segment_lengths, wrap_angle
from antdrive.base.types import Pose
from antdrive.foreign.log import ForeignLog
from antdrive.proof import Proof, Track, prove
from antdrive.proof.track import PERIOD, bounded
from antdrive.robots.clearance import footprint_distances
from antdrive.robots.spec import RobotSpec
from antdrive.sim.log.certificate import at_least, in_metres
from antdrive.worlds.world import World, obstacle_name

#: Distance between interpolated rows, below which a finer proof gains little [m], and most of them between two poses.
FINE, MOST_PIECES = 0.005, 20


@dataclass(frozen=True, eq=False)
class ForeignCertificate:
    """What the log of another program proves.

    Attributes:
        log: the robot's poses
        world: the world
        frame: pose of the world's frame in the log's map [m, m, rad]
        robot: the robot's outline and limits
        others: logs of other robots in the same map, with stamps of one clock, and these robots
        pose_error: how far a point of an outline may be from where a log has it [m]
        overhang: how far cylinders reach beyond what stands in the map [m]
        tracks: the tracks of the robot and of the others, with rows at the stamps of all logs
        proof: how clear the robot is, for an error of all poses that is stated, or greater and shown by the log
        shown_error: error that some pose has at least, since poses lie too far apart for top speeds [m]
        most_error: greatest error of all poses for which the robot is clear [m]; 0: for none

    Raises:
        FieldError: the poses leap between so many obstacles that checking them would take too long.
        InputError: another log has no time in common with the robot's.
    """

    claim: ClassVar[str] = "proved clear, as assumed"  # of a log that proves it
    log: ForeignLog
    world: World
    frame: Pose
    robot: RobotSpec
    others: tuple[tuple[ForeignLog, RobotSpec], ...] = ()
    pose_error: float = 0.0
    overhang: float = 0.0
    tracks: tuple[Track, ...] = field(init=False)
    proof: Proof = field(init=False)
    shown_error: float = field(init=False)
    most_error: float = field(init=False)

    def __post_init__(self) -> None:
        log = self.log
        moved = [(one, body, one.t + (one.start - log.start)) for one, body in ((log, self.robot), *self.others)]
        pieces = np.clip(np.ceil(segment_lengths(log.pose[:, :2]) / FINE), 1, MOST_PIECES)
        ends = np.append(0, np.cumsum(pieces))
        fine = np.interp(np.arange(ends[-1] + 1), ends, log.t)
        at = functools.reduce(np.union1d, [t for _, _, t in moved[1:]], fine)
        at = at[(at >= log.t[0]) & (at <= log.t[-1])]

        def tracks(error: float) -> tuple[Track, ...]:
            placed = ((t, map_to_world(self.frame, one.pose), body, one.unknown) for one, body, t in moved)
            return tuple(
                Track.limited(t, pose, body, at=at, unknown=lost, error=error) for t, pose, body, lost in placed
            )

        shown = max(_shown_error(one, body) for one, body, _ in moved)
        robots = tracks(max(self.pose_error, shown))
        for (one, _), track in zip(self.others, robots[1:], strict=True):
            if np.isnan(track.reach).all():
                raise input_error(one.source["file"], f"has no time in common with {log.source['file']}")
        proof, most = prove(robots[0], self.world, robots[1:]), math.inf
        for _ in range(3):  # bounds fall as errors grow: from infinity, each other one holds for all lesser errors
            first, *rest = tracks(most)
            most = max(0.0, bounded(proof.gaps, first, rest).bound) / min(2, len(robots))
        vars(self).update(tracks=robots, proof=proof, shown_error=shown, most_error=most)

    @property
    def names(self) -> list[str]:
        """The names of the other robots."""
        return [f"{body.name} of {log.source['file']}" for log, body in self.others]

    @property
    def min_clearance(self) -> float:
        """The distance that the robot came to, if the poses are exact [m]."""
        return float((self.proof.clearance + self.proof.off).min())

    @property
    def bound(self) -> float:
        """Proven distance at all times, for poses that are off as the proof says [m]."""
        return self.proof.bound - self.proof.error

    @property
    def touched(self) -> bool:
        """Whether the robot overlapped something, whatever the errors of poses and cylinders are."""
        return self.min_clearance < -self.proof.error - self.overhang

    @property
    def certified(self) -> bool:
        """Whether the robot is proved clear."""
        return self.bound > 0

    @property
    def problems(self) -> tuple[str, ...]:
        """Why the robot is not proved clear, in a sentence; none if it is."""
        error, between = (
            self.tracks[0].error,
            " and ".join(f"{t:.3f} s" for t in self.tracks[0].t[self.proof.row :][:2]),
        )
        shows = self.shown_error == error > 0
        how = "at least {}, since they lie too far apart for top speeds" if shows else "up to {}, as stated"
        off = f"poses are off by {how.format(in_metres(error))}; the robot is clear below {at_least(self.most_error)}"
        reasons = {
            f"the robot touched {self.nearest}": self.touched,
            f"nothing can be said between t = {between}: there are no poses to rely on": self.bound == -math.inf,
            f"contact cannot be ruled out between t = {between}, near {self.nearest}": self.most_error == 0,
            off: not self.certified,
        }
        return tuple(reason for reason, holds in reasons.items() if holds)[:1]

    @functools.cached_property
    def nearest(self) -> str:
        """The thing that the robot came nearest to, by how much, when and where, in words."""
        row = int((self.proof.clearance + self.proof.off).argmin())
        gaps = footprint_distances(self.world, self.robot, self.tracks[0].pose[[row]])[0]
        names = [obstacle_name(self.world, i) for i in range(len(gaps))] + self.names
        gaps = np.append(gaps, [gap[row] for gap in self.proof.gaps[1:]])
        x, y = self.tracks[0].pose[row, :2].tolist()
        at = f"t = {self.tracks[0].t[row]:.3f} s, the robot at {format_point((x, y), 2)}"
        far = f"{'overlapped by ' if self.min_clearance < 0 else ''}{in_metres(abs(self.min_clearance))}"
        return f"{names[int(np.nanargmin(gaps))]}: {far} at {at}"

    @property
    def assumptions(self) -> tuple[str, ...]:
        """What the proof assumes, a sentence each."""
        r = self.robot
        speeds = f"{r.max_speed:g} m/s, {r.max_yaw_rate:g} rad/s"
        changes = f"{r.max_acceleration:g} m/s2, {r.max_yaw_acceleration:g} rad/s2"
        movers = f"; its {len(self.world.movers)} movers were elsewhere" if self.world.movers else ""
        ends = [track.t[np.isfinite(track.pose[:, 0])][[0, -1]].tolist() for track in self.tracks]
        return (
            f"the robot kept its limits ({r.name}: {speeds}, {changes}), and commands came at {1 / PERIOD:g} Hz or faster",
            f"each point of it was within {in_metres(self.tracks[0].error)} of where the log has it",
            *(f"{name} kept its limits and error too, and its stamps are of the same clock" for name in self.names),
            f"all that stood is in {self.world.name}, and all that moved is named{movers}",
            *(
                f"{name} was elsewhere before t = {first:.3f} s and after t = {last:.3f} s"
                for name, (first, last) in zip(self.names, ends[1:], strict=True)
                if [first, last] != ends[0]
            ),
        )

    @property
    def caption(self) -> str:
        """Line at the end of films."""
        least = f": never closer than {self.bound:.3f} m" if self.certified else ""
        return f"foreign log {self.statement}{least}"

    @property
    def statement(self) -> str:
        """Whether the robot is proved clear, in words; unlike those of a drive's certificate."""
        return self.claim if self.certified else "NOT proved clear"

    @property
    def sentence(self) -> str:
        """Statement with its distances."""
        least, most = at_least(self.bound), at_least(self.most_error)
        clear = f"by at least {least} at all times; it is clear for all pose errors below {most}"
        return f"{self.statement}: {clear if self.certified else self.problems[0]}"

    def as_dict(self) -> dict[str, Any]:
        """Return the certificate as plain values, for JSON."""
        return {
            "kind": "foreign",
            "proved_clear": self.certified,
            "touched": self.touched,
            "min_clearance_m": self.min_clearance,
            "bound_m": self.bound if math.isfinite(self.bound) else None,
            "clear_for_pose_errors_below_m": self.most_error,
            "pose_error_m": self.tracks[0].error,
            "shown_error_m": self.shown_error,
            "nearest": self.nearest,
            "problems": list(self.problems),
            "findings": list(self.log.findings),
            "assumptions": list(self.assumptions),
            "world": self.world.name,
            "robot": self.robot.name,
            "others": self.names,
            "duration_s": float(self.log.t[-1]),
            "start": self.log.start,
            "source": dict(self.log.source),
            "sha256": hashlib.sha256(self.log.t.tobytes() + self.log.pose.tobytes()).hexdigest(),
        }


def _shown_error(log: ForeignLog, robot: RobotSpec) -> float:
    """Return the error that some pose of a log has at least, since poses lie too far apart for the robot's top speeds [m].

    Compared are poses 1, 2, 4, ... rows apart.
    """
    lost, count, most = np.append(0, np.cumsum(log.unknown)), len(log.t), 0.0
    for k in (1 << j for j in range((count - 1).bit_length())):
        dt, step = log.t[k:] - log.t[:-k], log.pose[k:] - log.pose[:-k]
        apart = (np.hypot(*step[:, :2].T) - robot.max_speed * dt) / 2
        # Of two yaws that differ by too much, one is off by half of that; some point of the outline lies half the radius
        # or more from any centre of rotation.
        turn = np.maximum(np.abs(wrap_angle(step[:, 2])) - robot.max_yaw_rate * dt, 0.0)
        apart = np.maximum(apart, robot.footprint.radius * np.sin(turn / 4))
        most = max(most, float(apart[lost[k:] == lost[:-k]].max(initial=0.0)))
    return most
