"""`antdrive worlds list`."""

from antdrive.cli import options
from antdrive.cli.console import print_json, print_table
from antdrive.cli.exits import SUCCEEDED
from antdrive.cli.output import task_facts


def list_worlds(json: options.Json = False) -> int:
    """List the worlds in the catalogue."""
    from antdrive.worlds import list_worlds as catalogue
    from antdrive.worlds import load_task

    tasks = {name: load_task(name) for name in catalogue()}
    if json:
        print_json({name: task_facts(task) for name, task in tasks.items()})
        return SUCCEEDED
    print_table(
        ("world", "size m", "obstacles", "movers", "cell m", "about"),
        (
            (
                name,
                "{:g} x {:g}".format(*task.world.size),
                str(len(task.world.obstacles)),
                str(len(task.world.movers)),
                f"{task.cell:g}",
                task.world.source or "",
            )
            for name, task in tasks.items()
        ),
    )
    return SUCCEEDED
