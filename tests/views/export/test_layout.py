"""The layout's panels match foxglove-sdk's typed panels."""

from __future__ import annotations

import dataclasses
import inspect
import re

import pydantic
import pytest
from foxglove import layouts

from antdrive.views.export.exporting import foxglove_layout

#: Of the program's own files, not of the types: titles, and what axisSize was called before.
ELSEWHERE = {"foxglovePanelTitle", "lichtblickPanelTitle", "axisScale"}
CONFIGS = {"3D": "ThreeDeeConfig", "Plot": "PlotConfig", "StateTransitions": "StateTransitionsConfig"}
TOPICS = {
    "/map": "BaseRendererRosOccupancyGridTopicSettings",
    "/plan": "BaseRendererPosesTopicSettings",
    "/scan": "BaseRendererLaserScanTopicSettings",
    "/robot_description": "BaseRendererUrdfTopicSettings",
    "/obstacles": "BaseRendererRosMarkerTopicSettings",
    "/movers": "BaseRendererRosMarkerTopicSettings",
    "/contacts": "BaseRendererRosMarkerTopicSettings",
}


@pytest.fixture(scope="module", autouse=True)
def strict_types():
    """Types that reject unknown keys."""
    for kind in vars(layouts).values():
        if inspect.isclass(kind) and dataclasses.is_dataclass(kind):
            kind.__pydantic_config__ = pydantic.ConfigDict(extra="forbid")


@pytest.fixture(scope="module")
def panels(made_up_drive):
    return foxglove_layout(made_up_drive(movers=1))["configById"]


def snake(value, named=True):
    """Convert keys to the types' names, except the user-defined keys of `topics` and others."""
    if isinstance(value, list):
        return [snake(entry) for entry in value]
    if not isinstance(value, dict):
        return value
    known = {key: entry for key, entry in value.items() if key not in ELSEWHERE}
    return {
        re.sub("([A-Z])", r"_\1", key).lower() if named else key: snake(entry, key not in ("topics", "layers"))
        for key, entry in known.items()
    }


def test_panels_are_as_the_types_have_them(panels):
    for name, config in panels.items():
        kind = getattr(layouts, CONFIGS[name.split("!")[0]])
        given = {key: value for key, value in config.items() if key != "topics"}
        pydantic.TypeAdapter(kind).validate_python(snake(given))


def test_topics_are_as_the_types_have_them(panels):
    topics = panels["3D!drive"]["topics"]
    assert set(topics) == set(TOPICS)
    for name, settings in topics.items():
        pydantic.TypeAdapter(getattr(layouts, TOPICS[name])).validate_python(snake(settings))
