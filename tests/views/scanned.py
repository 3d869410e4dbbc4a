"""A made-up drive with the scans that its robot's lidar would have taken."""

import dataclasses

import numpy as np

from antdrive.sim.log.record import SensingRecord
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.log.scans import millimetres
from antdrive.sim.sensing import Scanner


def scanned(drive: Rollout, **changes: float) -> Rollout:
    """The drive of a robot without a map and without noise; `changes` are of its lidar."""
    lidar = drive.record.robot.lidar
    assert lidar is not None
    exact = dataclasses.replace(lidar, **{"sigma": 0.0, "resolution": 0.0, "rate": 10.0, **changes})
    rows = np.arange(0, len(drive.t), round(drive.record.physics_hz / exact.rate), dtype=np.int32)
    scanner = Scanner.of(exact, drive.record.world)
    x, y, yaw = drive.pose.T
    radii = np.array([mover.radius for mover in drive.record.world.movers])
    scans = [millimetres(scanner.scan((float(x[k]), float(y[k]), float(yaw[k])), drive.movers[k], radii)) for k in rows]
    record = dataclasses.replace(
        drive.record,
        robot=dataclasses.replace(drive.record.robot, lidar=exact),
        sensing=SensingRecord(map="none", localisation="true", odometry=1.0),
    )
    return dataclasses.replace(drive, record=record, scans=np.array(scans), scan_rows=rows)
