"""Settings without effect: for each setting, a reason why it cannot act in a scenario; empty if it can."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import TypeAlias

from antdrive.sim.scenario import Scenario
from antdrive.sim.settings import SETTINGS

#: Returns why the setting with a key, such as `controller.blend`, cannot act in a scenario; empty if it can.
Idle: TypeAlias = Callable[[Scenario, str], str]


def if_timed(s: Scenario, key: str) -> str:
    """Return a reason for a planner whose line is driven as planned."""
    why = "plans in space and time; its cells are" if s.timed else "is a plan of a file; its line is"
    return "" if s.smoothing == s.driven_smoothing else f"{s.planner_label} {why} driven as planned"


def without_noise(s: Scenario, key: str) -> str:
    """Return a reason for a robot without noise levels and without scans."""
    if s.scans or s.robot.noise.nonzero:
        return ""
    return f"the robot file of {s.robot.name} has no noise section"


def with_exact_fixes(s: Scenario, key: str) -> str:
    """Return a reason for true poses where fixes have no error either."""
    return "without noise, fixes are exact as well" if s.localisation == "true" and not s.noisy else ""


def without_odometry(s: Scenario, key: str) -> str:
    """Return a reason for a robot that is localised otherwise."""
    if s.drifting or (s.localisation == "fixes" and s.mapless and s.noisy):
        return ""
    return f"localisation {s.localisation} uses no odometry errors here; odometry, matching and noisy fixes without a map do"


def on_other_routes(s: Scenario, key: str) -> str:
    """Return a reason for an option of the controller that acts only on routes of the other kind."""
    from antdrive.robots.control.pursuit import CORNERS, SMOOTH, controller_options

    options, name = controller_options(), key.partition(".")[2]
    if name not in options:
        return ""
    raw = s.driven_smoothing == "none"
    if options[name].acts_on is SMOOTH and raw:
        return f"routes without smoothing have corners; set controller.corner_{name}"
    if options[name].acts_on is CORNERS and not raw and not s.mapless and not s.moving:
        return f"smoothing {s.smoothing} leaves no corners; set controller.{name.removeprefix('corner_')}"
    return ""


def with_one_shape(s: Scenario, key: str) -> str:
    """Return a reason for a robot that is a disc, and for a planner that plans for the disc."""
    if s.robot.footprint.is_disc:
        return f"{s.robot.name} is a disc"
    if s.footprint != "auto" and not s.plans_footprints:
        return f"{s.planner_label} plans for the disc around the robot"
    return ""


def without_movers(s: Scenario, key: str) -> str:
    """Return a reason for a world without movers, in which the robot looks for none."""
    return "" if s.moving else "the world has no movers"


def without_choice_of_perception(s: Scenario, key: str) -> str:
    """Return a reason for a world without movers, and for a planner that knows their motions."""
    if s.timed:
        return f"{s.planner_label} is given the movers' motions"
    return "" if s.perception == s.usual_perception else without_movers(s, key)


def without_replans(s: Scenario, key: str) -> str:
    """Return a reason for a drive without movers on a given map."""
    return without_movers(s, key) if not s.mapless else ""


def without_chance(s: Scenario, key: str) -> str:
    """Return a reason for a drive that draws no random numbers."""
    from antdrive.planners import capabilities_of
    from antdrive.worlds import Wandering

    wander = any(isinstance(one, Wandering) and one.seed is None for one in s.driven_world.movers)
    if s.noisy or s.drifting or wander or (s.scans and s.noise) or not capabilities_of(s.planner).deterministic:
        return ""
    return f"{s.planner_label} and the drive draw no random numbers"


#: Why the setting of a field cannot act; the others always can.
IDLE: Mapping[str, Idle] = {
    "smoothing": if_timed,
    "noise": without_noise,
    "footprint": with_one_shape,
    "localisation": with_exact_fixes,
    "odometry": without_odometry,
    "controller": on_other_routes,
    "perception": without_choice_of_perception,
    "avoidance": without_movers,
    "replanning": without_replans,
    "seed": without_chance,
}


def idle_settings(s: Scenario, given: Collection[str] = ()) -> dict[str, str]:
    """Return the settings that cannot act in a scenario: the reason of each by its key.

    >>> idle_settings(Scenario.of("forest", "astar", seed=1))
    {'seed': 'astar and the drive draw no random numbers'}

    Args:
        s: the scenario
        given: keys of settings to include at their defaults; the others are included if they differ
    """
    keys = (
        (name, key)
        for name in IDLE
        for one in (SETTINGS[name],)
        for key in one.keys(getattr(s, name)) or ([one.key] if one.key in given else [])
    )
    reasons = {key: IDLE[name](s, key) for name, key in keys}
    return {key: reason for key, reason in reasons.items() if reason}


def idle_notes(scenarios: Sequence[Scenario], given: Collection[str] = ()) -> list[str]:
    """Return a sentence for every setting without effect in some of the scenarios.

    Args:
        scenarios: one for each configuration
        given: keys of settings that count as given even at their defaults
    """
    found: dict[tuple[str, str], list[str]] = {}
    for s in scenarios:
        for key, reason in idle_settings(s, given).items():
            found.setdefault((key, reason), []).append(f"{s.task.world.name} with {s.planner_label}")
    return [f"{key} has no effect{_share(places, len(scenarios))}: {reason}" for (key, reason), places in found.items()]


def _share(places: Iterable[str], count: int) -> str:
    """Return in which of the configurations something holds; empty if in all."""
    names = list(places)
    return "" if len(names) == count else f" in {len(names)} of {count} configurations, such as {names[0]}"
