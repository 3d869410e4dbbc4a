"""`antdrive controller`."""

from typing import Annotated

from antdrive.base.tables import table
from antdrive.cli import options
from antdrive.cli.commands.planners import details
from antdrive.cli.console import show
from antdrive.cli.options import argument, flag


def controller(
    names: Annotated[
        list[str] | None, argument("NAME", "Controllers to describe with their options: names or FILE.py:CLASS.")
    ] = None,
    nav2: Annotated[bool, flag("List Nav2's parameters and their counterparts instead.", "--nav2")] = False,
    json: options.Json = False,
) -> None:
    """List the options of pure pursuit, or describe controllers."""
    from antdrive.base.registry import describe, options_card
    from antdrive.robots import list_controllers, load_controller
    from antdrive.robots.control.nav2 import NAV2
    from antdrive.robots.control.pursuit import controller_options
    from antdrive.sim.forms import USUAL_CONTROLLER

    if nav2:
        show(json, dict(NAV2), table(("Nav2's Regulated Pure Pursuit", "antdrive"), NAV2.items()))
        return
    if names:
        made = {name: load_controller(name) for name in names}
        described = {name: {"about": describe(one), **options_card(one)} for name, one in made.items()}
        show(json, described, details(described))
        return
    known = controller_options()
    facts = {
        name: {"default": one.default, "unit": one.unit, "about": one.meaning, "routes": one.routes}
        for name, one in known.items()
    }
    rows = ((name, f"{one.default:g} {one.unit}".strip(), one.routes, one.meaning) for name, one in known.items())
    others = ", ".join(name for name in list_controllers() if name != USUAL_CONTROLLER)
    show(json, facts, [*table(("option", "default", "routes", "meaning"), rows), f"others, by name: {others}"])
