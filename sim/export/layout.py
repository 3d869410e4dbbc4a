"""The layout of Foxglove's and Lichtblick's panels for an exported drive: the scene from above, and curves beside it."""

from __future__ import annotations

from typing import Any

import numpy as np

from antdrive.sim.export.frames import MAP
from antdrive.sim.log.rollout import Rollout
from antdrive.worlds.plane import in_map

SHOWN = ("/map", "/plan", "/obstacles", "/movers", "/contacts", "/scan", "/robot_description")
TITLES = ("foxglovePanelTitle", "lichtblickPanelTitle")  # what each of the two programs calls a panel's title
MARGIN = 1.15  # how much more than the world the picture shows
SCENE, CLEARANCE, SPEEDS, LIMITER = "3D!drive", "Plot!clearance", "Plot!speeds", "StateTransitions!limiter"


def foxglove_layout(rollout: Rollout) -> dict[str, Any]:
    """The layout as plain data, for JSON.

    Args:
        rollout: the log
    """
    x0, y0, x1, y1 = rollout.record.world.bounds
    corners = in_map(rollout.record.task.frame, [(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
    low, high = corners.min(axis=0), corners.max(axis=0)
    return {
        "configById": {
            SCENE: _scene(((low + high) / 2).tolist(), float(MARGIN * np.max(high - low))),
            CLEARANCE: _plot("Clearance [m]", {"/clearance.data": "clearance"}),
            SPEEDS: _plot("Speed [m/s]", {"/cmd_vel.linear.x": "commanded", "/odom.twist.twist.linear.x": "measured"}),
            LIMITER: {
                **dict.fromkeys(TITLES, "Limited by"),
                "paths": [
                    {
                        "value": "/limiter_name.data",
                        "label": "limited by",
                        "enabled": True,
                        "timestampMethod": "receiveTime",
                    }
                ],
                "isSynced": True,
            },
        },
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": {
            "direction": "row",
            "first": SCENE,
            "second": {
                "direction": "column",
                "first": CLEARANCE,
                "second": {"direction": "column", "first": SPEEDS, "second": LIMITER, "splitPercentage": 65},
                "splitPercentage": 40,
            },
            "splitPercentage": 62,
        },
    }


def _scene(middle: list[float], height: float) -> dict[str, Any]:
    """The scene from straight above, x to the right."""
    return {
        "cameraState": {
            "perspective": False,
            "distance": height,
            "phi": 0,
            "thetaOffset": 0,
            "targetOffset": [*middle, 0],
            "target": [0, 0, 0],
            "targetOrientation": [0, 0, 0, 1],
            "fovy": 45,
            "near": 0.01,
            "far": 5000,
        },
        "followMode": "follow-none",
        "followTf": MAP,
        "scene": {"transforms": {"editable": False, "axisScale": 0}, "enableStats": False},
        "transforms": {},
        "topics": {topic: {"visible": True} for topic in SHOWN},
        "layers": {},
        "imageMode": {},
    }


def _plot(title: str, lines: dict[str, str]) -> dict[str, Any]:
    return {
        **dict.fromkeys(TITLES, title),
        "paths": [
            {"value": path, "label": label, "enabled": True, "timestampMethod": "receiveTime"}
            for path, label in lines.items()
        ],
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "showLegend": True,
        "legendDisplay": "floating",
        "showPlotValuesInLegend": False,
        "sidebarDimension": 240,
        "isSynced": True,
        "xAxisVal": "timestamp",
    }
