"""`antdrive certify`."""

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from antdrive.base.checks import pair
from antdrive.base.errors import InputError
from antdrive.base.progress import shown_progress
from antdrive.base.tables import file_lines, marked
from antdrive.cli import options
from antdrive.cli.console import show
from antdrive.cli.options import argument, option
from antdrive.cli.output import film_drives

if TYPE_CHECKING:
    from antdrive.sim.facts import Run


def certify(
    log: Annotated[str, argument("LOG", "ROS bag (folder, .mcap, .db3, .bag), .tum or .csv file of poses.")],
    world: Annotated[
        str | None, option("MAP", "World name or file, or map_server .yaml.  [default: the bag's map]", "--map")
    ] = None,
    robot: Annotated[str, option("NAME", "Robot name or file, or .urdf or .xacro; its limits count.")] = "turtlebot",
    pose: Annotated[str | None, option("TOPIC", "Poses in a bag.  [default: its transforms]")] = None,
    map_frame: Annotated[str | None, option("FRAME", "Frame of the map.  [default: map]")] = None,
    robot_frame: Annotated[
        str | None, option("FRAME", "Robot's frame, or its name in a table.  [default: base_footprint or base_link]")
    ] = None,
    footprint: Annotated[str | None, option("TOPIC", "Outline of the robot in a bag.  [default: the robot's]")] = None,
    other: Annotated[
        list[str] | None, option("LOG=ROBOT", "Another robot, by a log of the same clock or a topic. Repeatable.")
    ] = None,
    pose_error: Annotated[
        float, option("METRES", "How far a point of the robot may be from where the log has it [m].", min=0.0)
    ] = 0.0,
    unknown: Annotated[str, option("KIND", "Unknown cells of the map are blocked or free.")] = "blocked",
    out: Annotated[Path | None, option("FOLDER", "Write certificate.json and a figure into a folder.")] = None,
    page: Annotated[Path | None, option("FILE", "Write the page of the log: .html.")] = None,
    film: Annotated[Path | None, option("FILE", "Film the log: .mp4, .gif or .webp.")] = None,
    export: Annotated[Path | None, option("FILE", "Export it with obstacles and clearance to an .mcap file.")] = None,
    init: Annotated[Path | None, option("FILE", "Write all that was guessed as a suite, to be reviewed.")] = None,
    json: options.Json = False,
) -> bool:
    """Prove another program's log clear of a map and of other robots.

    Between poses the robot keeps the limits of its file. The result is a foreign certificate: it names its assumptions, the
    largest pose error for which it holds, and gaps, jumps and corrections of the log.
    Exit code 0: proved clear. 1: touched, or a contact cannot be ruled out.
    """
    from antdrive.foreign.playback import foreign_run
    from antdrive.foreign.setup import ForeignSetup

    words: Any = {"log": log, "world": world, "robot": robot, "pose": pose, "footprint": footprint, "unknown": unknown}
    words |= {"map_frame": map_frame, "robot_frame": robot_frame, "pose_error": pose_error}
    others = dict(pair(text, "--other", "LOG=ROBOT") for text in other or ())
    if len(others) < len(other or ()):
        raise InputError("--other: names one log twice")
    setup = ForeignSetup(**words, others=others)
    with shown_progress("reading"):
        found = setup.certificate()
    used = {key.replace("_", " "): value for key, value in found.log.source.items() if key != "file"}
    facts = [("nearest", found.nearest), *used.items(), ("map", found.world.source or found.world.name)]
    facts += [("found", finding) for finding in found.log.findings]
    facts += [("assumed", assumption) for assumption in found.assumptions]
    lines = [marked(found.certified, f"{log}: foreign certificate"), *_indented("", found.sentence)]
    lines += [line for key, value in facts for line in _indented(key, value)]
    files = _written(foreign_run(found, setup), out, page, film, export) if out or page or film or export else {}
    if init is not None:
        files["suite"] = str(setup.write_suite(found, init))
    show(json, {**found.as_dict(), "files": files}, [*lines, *file_lines(files)])
    return found.certified


def _written(run: "Run", out: Path | None, page: Path | None, film: Path | None, export: Path | None) -> dict[str, str]:
    """Write certificate and figure into a folder, a page, a film and a bag; return the files by kind."""
    from antdrive.views.export.exporting import export_foreign
    from antdrive.views.figures.run_figures import draw_run
    from antdrive.views.run_folder import check_film

    check_film(film, 0.0, ())
    assert run.rollout is not None
    files: dict[str, str] = {}
    if out is not None:
        files |= run.rollout.write_proof(out) | {"figure": str(out / "overview.png")}
        draw_run(run, files["figure"])
    if page is not None:
        from antdrive.views.viewer.drive_page import write_page

        files["page"] = str(write_page([run], page))
    if film is not None:
        files["film"] = film_drives(run.rollout, film)["file"]
    return files if export is None else files | export_foreign(run.rollout, export)


def _indented(key: str, text: str) -> list[str]:
    """Return a fact as lines of a table."""
    return textwrap.wrap(text, 80, initial_indent=f"  {key:12} ", subsequent_indent=" " * 15)
