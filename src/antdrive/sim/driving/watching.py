"""Movers that the robot finds in its lidar's scans, and the prediction that follows from them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats, Pose
from antdrive.robots.lidar import Lidar
from antdrive.sim.driving.own_map import MAP_CELL
from antdrive.sim.driving.perception import Perception, Predictor
from antdrive.sim.sensing.ground import Ground, MappedGround
from antdrive.sim.sensing.mapping import OccupancyMap
from antdrive.sim.sensing.tracking import MoverTracker, TrackedMovers
from antdrive.worlds import Trajectories, World

STANDS = 0.08  # a mover that is slower than this, as far as scans tell, stands still [m/s]


class Watch:
    """What a robot's scans tell of movers, and the log of it.

    Attributes:
        tracker: finds and follows them
        tick: the control period of the last scan
        sight: the ground that its beams crossed within `reach` [m^2]
        reach: up to where beams lie no farther apart than a cell of a map [m]
    """

    def __init__(self, lidar: Lidar, hz: int, pose_xy: float = 0.0, pose_yaw: float = 0.0) -> None:
        lidar = lidar.at(hz)
        self.tracker, self.tick = MoverTracker(lidar, None, pose_xy, pose_yaw), 0
        self.sight, self.reach = 0.0, min(lidar.max_range, MAP_CELL / lidar.spacing)
        self._hz, self._spacing = hz, lidar.spacing
        self._settle = max(2, round(self.tracker.policy.settle * lidar.rate))
        self._log: list[tuple[int, TrackedMovers]] = []

    def read(self, ground: Ground, pose: Pose, ranges: Floats, tick: int) -> npt.NDArray[np.bool_]:
        """Read a scan; which beams met movers that are followed (beams,)."""
        theirs = self.tracker.update(ground, pose, ranges, tick / self._hz)
        self.tick = tick
        crossed = np.clip(ranges, 0.0, self.reach)
        self.sight = float(0.5 * self._spacing * (crossed * crossed).sum())
        self._log.append((tick, self.tracker.movers()))
        return theirs

    def read_on_map(self, seen: OccupancyMap, pose: Pose, ranges: Floats, tick: int) -> npt.NDArray[np.bool_]:
        """The same for a robot that makes its own map, before the scan is entered."""
        return self.read(MappedGround(seen, self._settle), pose, ranges, tick)

    def standing(self, seen: OccupancyMap, pose: Pose, ranges: Floats, tick: int) -> Floats:
        """A scan that was not read yet without what may move (beams,) [m]: nothing is in range there."""
        ground = MappedGround(seen, self._settle)
        return np.where(self.tracker.suspected(ground, pose, ranges, tick / self._hz), np.inf, ranges)

    def logged(self, per_tick: int, rows: int) -> npt.NDArray[np.float32]:
        """The movers that were followed, as the array `tracks` of a log has them (K, 7)."""
        tables = [
            np.column_stack(
                (
                    np.full(len(found.radii), tick * per_tick),
                    found.numbers,
                    found.positions,
                    found.velocities,
                    found.radii,
                )
            )
            for tick, found in self._log
            if tick * per_tick < rows
        ]
        return np.concatenate(tables).astype(np.float32) if tables else np.empty((0, 7), dtype=np.float32)


class TrackedPredictor(Predictor):
    """Predicts movers from a watch: whatever is followed goes on at the velocity that was estimated.

    Movers are counted as they are found. In arrays of all movers those that are not followed any more have no place.

    Attributes:
        watch: what the scans tell
    """

    def __init__(self, watch: Watch, perception: Perception, hz: int) -> None:
        nothing = World("nothing", (0.0, 0.0, 1.0, 1.0))
        super().__init__(Trajectories.of(nothing, (0.5, 0.5)), perception, hz)
        self.watch = watch

    def predict(self, tick: int, robot: tuple[float, float], ahead: Floats) -> tuple[Floats, Floats]:
        """Predict the movers that the robot follows.

        Returns:
            The movers' positions (K, M, 2) [m] and radii (M,) [m].
        """
        found, places, velocities = self._followed(tick)
        near = self._near(places, found.radii, robot)
        return places[near] + ahead[:, None, None] * velocities[near], found.radii[near]

    def perceived(self, tick: int, robot: tuple[float, float]) -> tuple[npt.NDArray[np.int64], Floats]:
        """The numbers (P,) of the movers that are followed, and where all are by their numbers (M, 2) [m]; nan: not known."""
        found, places, _ = self._followed(tick)
        everywhere = np.full((self.watch.tracker.found, 2), np.nan)
        everywhere[found.numbers] = places
        return found.numbers[self._near(places, found.radii, robot)], everywhere

    def sighted(self, tick: int) -> Floats:
        """Where the movers are in a tick that the last scan met (N, 2) [m]: not those that are hidden."""
        found, places, _ = self._followed(tick)
        return places[found.met]

    def within_range(self, tick: int, robot: tuple[float, float]) -> npt.NDArray[np.int64]:
        """The numbers (M,) of the movers that a robot at a position [m] follows in a tick."""
        found, places, _ = self._followed(tick)
        return found.numbers[self._near(places, found.radii, robot)]

    def radius_of(self, mover: int) -> float:
        """The radius of a mover that is followed [m]."""
        found = self.watch.tracker.movers()
        return float(found.radii[found.numbers == mover][0])

    def name_of(self, mover: int) -> str:
        """What people call a mover."""
        return f"tracked mover {mover}"

    def _followed(self, tick: int) -> tuple[TrackedMovers, Floats, Floats]:
        """The movers at the last scan, where they are in a tick (M, 2) [m], and their velocities (M, 2) [m/s]."""
        found = self.watch.tracker.movers()
        velocities = np.where(np.hypot(*found.velocities.T)[:, None] < STANDS, 0.0, found.velocities)
        return found, found.positions + (tick - self.watch.tick) / self._hz * velocities, velocities

    def _near(self, places: Floats, radii: Floats, robot: tuple[float, float]) -> npt.NDArray[np.bool_]:
        return np.asarray(np.hypot(*(places - robot).T) - radii <= self._perception.range)
