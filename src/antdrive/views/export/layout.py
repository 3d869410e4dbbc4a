"""The layout of Foxglove's and Lichtblick's panels for an exported drive: the scene from above, and curves beside it."""

from __future__ import annotations

from typing import Any

from antdrive.base.plane import in_map
from antdrive.base.types import Floats
from antdrive.sim.log.rollout import Rollout
from antdrive.views.export.frames import MAP

#: The topics of the scene with their settings, where the programs' own would not do: without intensities scans have no colour.
SHOWN: dict[str, dict[str, Any]] = {
    "/map": {"colorMode": "custom", "minColor": "#f2f4f8ff", "maxColor": "#c3cedeff", "unknownColor": "#a9b0bcff"},
    "/plan": {"type": "line", "lineWidth": 0.05, "gradient": ["#182242ff", "#182242ff"]},
    "/obstacles": {},
    "/movers": {},
    "/contacts": {},
    "/scan": {"colorMode": "flat", "flatColor": "#0a6fd6ff", "colorField": "range", "pointSize": 4},
    "/robot_description": {},
}
TITLES = ("foxglovePanelTitle", "lichtblickPanelTitle")  # what each of the two programs calls a panel's title
MARGIN = 1.1  # how much more than the world the picture shows
ASPECT = 0.75  # width over height of the scene's panel, at least: in a window of 1400 x 900 beside an open side bar
SCENE, CLEARANCE, SPEEDS, LIMITER = "3D!drive", "Plot!clearance", "Plot!speeds", "StateTransitions!limiter"


def foxglove_layout(rollout: Rollout) -> dict[str, Any]:
    """The layout as plain data, for JSON."""
    x0, y0, x1, y1 = rollout.record.world.bounds
    corners = in_map(rollout.record.task.frame, [(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
    low, high = corners.min(axis=0), corners.max(axis=0)
    return {
        "configById": {
            SCENE: _scene(((low + high) / 2).tolist(), _height(high - low)),
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


def _height(size: Floats) -> float:
    """How much the picture shows from bottom to top, so that a rectangle of a size (2,) is in it [m]."""
    return float(MARGIN * max(size[0] / ASPECT, size[1]))


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
        "scene": {
            # axisScale is what axisSize was called before, and still is in Lichtblick.
            "transforms": {"editable": False, "showLabel": False, "axisScale": 0, "axisSize": 0, "lineWidth": 0},
            "enableStats": False,
        },
        "transforms": {},
        "topics": {topic: {"visible": True, **settings} for topic, settings in SHOWN.items()},
        "layers": {},
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
