"""`antdrive robots`, or `antdrive robots list`."""

from antdrive.cli import options
from antdrive.cli.console import print_json, print_table
from antdrive.cli.exits import SUCCEEDED


def list_all(json: options.Json = False) -> int:
    """List the robots in the catalogue."""
    from antdrive.robots import list_robots, load_robot, robot_to_dict

    specs = [load_robot(name) for name in list_robots()]
    if json:
        print_json({spec.name: robot_to_dict(spec) for spec in specs})
        return SUCCEEDED
    print_table(
        ("robot", "radius m", "m/s", "m/s2", "about"),
        (
            (spec.name, f"{spec.radius:.3f}", f"{spec.max_speed:g}", f"{spec.max_acceleration:g}", spec.source or "")
            for spec in specs
        ),
    )
    return SUCCEEDED
