"""Registry of controllers."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from antdrive.base.optional import CONTROLLER_GROUP
from antdrive.base.registry import Registry
from antdrive.robots.control.controller import Controller, ControllerError
from antdrive.robots.control.pursuit import PurePursuit
from antdrive.robots.controllers.coulter import Coulter
from antdrive.robots.controllers.dwa import DynamicWindow
from antdrive.robots.controllers.stanley import Stanley

#: The built-in controllers.
CONTROLLERS: Mapping[str, Controller] = MappingProxyType(
    {"pure-pursuit": PurePursuit(), "coulter": Coulter(), "stanley": Stanley(), "dwa": DynamicWindow()}
)


def _lacks(controller: Any) -> str:
    if isinstance(controller, Controller) and callable(controller.start) and callable(controller.step):
        return ""
    return "no methods start(briefing, path) and step(now, path, state); write both"


#: Controllers by name.
REGISTRY: Registry[Controller] = Registry(
    ControllerError,
    CONTROLLER_GROUP,
    lambda: CONTROLLERS,
    _lacks,
    {"start": ("briefing", "path"), "step": ("now", "path", "state")},
    reserved=("Session",),  # a loop of one's own
)


load_controller, list_controllers = REGISTRY.load, REGISTRY.all
