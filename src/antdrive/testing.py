"""For tests of drives: assertions, hypothesis strategies, and what the pytest fixture `drive` gives.

The pytest plugin that comes with antdrive collects suites, `*.drive.yaml`, and has the fixture.
"""

from typing import Any

from antdrive.cli import testing
from antdrive.runs import suites

# Their types are listed in testing.pyi; each is imported when it is first used.
_OFFERED = (
    *("Baseline", "CheckResult", "DriveFailure", "DriveFixture", "assert_collision_free", "assert_reached_goal"),
    *("check_case", "load_suite", "tasks", "worlds"),
)
__all__ = [*_OFFERED]


def __getattr__(name: str) -> Any:
    if name not in _OFFERED:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(testing if name in testing.__all__ else suites, name)


def __dir__() -> list[str]:
    return list(_OFFERED)
