"""Registry of controllers."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
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
)


def load_controller(name: str, home: Path | None = None, /, **options: Any) -> Controller:
    """Return the named controller with options set.

    Args:
        name: one of `list_controllers()`, or FILE.py:CLASS or MODULE:CLASS for user code
        home: folder of user code; None: the working directory
        options: the controller's options by name; values may be text, as from a command line

    Raises:
        InputError: the controller or option is unknown, or the value is invalid; lists the valid choices. Its key is
            `controller`, or `controller.` and the option.
    """
    return REGISTRY.load(name, home, **options)


def list_controllers() -> Mapping[str, Controller]:
    """Return all controllers by name, those of other packages last.

    A controller that fails to load is omitted with a warning.
    """
    return REGISTRY.all()
