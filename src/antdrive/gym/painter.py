"""Pictures of a running episode, by the films' compositor."""

from __future__ import annotations

from typing import Any

import numpy as np

from antdrive.base.types import Floats
from antdrive.robots import RobotSpec
from antdrive.worlds import Task

SIZE = (480, 360)  # width and height [px]


class Painter:
    """Pictures of one task and robot from above.

    Attributes:
        task: the task
    """

    def __init__(self, task: Task, robot: RobotSpec) -> None:
        from antdrive.views.film.camera import camera_for
        from antdrive.views.film.compositor import Compositor, drawn_height
        from antdrive.views.scene import Scene

        self.task = task
        scene = Scene.running(task, robot)
        low, high = np.array(scene.bounds[:2]), np.array(scene.bounds[2:])
        camera = camera_for("oblique", low, high, drawn_height(scene), SIZE)
        self._compositor = Compositor(scene, camera, route=np.empty((0, 2)))

    def picture(self, pose: Floats, movers: Floats) -> Any:
        """Return the picture (H, W, 3) of the robot at a pose among movers (M, 2) [m]."""
        return self._compositor.frame(pose, movers=movers)
