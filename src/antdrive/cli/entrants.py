"""Planners to compare, parsed from options of `antdrive compare`."""

from __future__ import annotations

import re
from collections.abc import Sequence

from antdrive.base.checks import grouped
from antdrive.base.errors import FieldError, InputError
from antdrive.base.user_code import label_names
from antdrive.cli.scenario_options import GROUPS, Setup

MAX_PLANNERS = 6


def check_worlds(words: Sequence[str]) -> None:
    """Raise an error for unknown worlds. Call it before parsing planners, which campaign folders do not need."""
    from antdrive.base.checks import resolve
    from antdrive.worlds.files.world_file import list_worlds

    known = list_worlds()
    for word in words:
        try:
            if resolve("world", word, known).is_dir():
                raise InputError(f"{word}: is neither a world file nor a campaign folder of antdrive sweep")
        except FieldError as error:
            raise InputError(error.problem) from None


def entrants_of(
    planners: Sequence[str] | None,
    settings: Sequence[str] | None,
    robot: str,
    controllers: Sequence[str] | None = None,
) -> dict[str, Setup]:
    """Parse planners, or several controllers with one planner, written NAME or LABEL=NAME, with their `--set GROUP.KEY=VALUE`.

    Return what is compared by label; a single controller is that of all.
    """
    controllers = controllers or ()
    follow, kind = len(controllers) > 1, "planner"
    words, labels = planners or (), dict[str, str]()
    if follow:
        if len(words) != 1:
            raise InputError("--planner: give one, with which several controllers are compared")
        words, kind = controllers, "controller"
    for word in words:
        label, mark, name = word.partition("=")
        if not label or (mark and not name) or label in GROUPS or (mark and not re.fullmatch(r"[\w-]{1,40}", label)):
            raise InputError(
                f"--{kind} {word}: must be NAME or LABEL=NAME, such as few=aco-han; labels use letters, digits, - and _"
            )
        labels[label] = name if mark else label
    bare = [label for label, name in labels.items() if label == name]
    short = dict(zip(bare, label_names(bare, labels.keys() - set(bare)), strict=True))
    labels = {short.get(label, label): name for label, name in labels.items()}
    if len(labels) < len(words) or not 2 <= len(labels) <= MAX_PLANNERS:
        raise InputError(
            f"{' '.join([f'--{kind}', *words])}: give two to six different {kind}s; "
            "label one to compare its options, such as --planner few=aco-han --set few.ants=10"
        )
    own: dict[str, list[str]] = {label: [] for label in labels}
    for text in settings or ():
        group, name, value = grouped(text, (*labels, *GROUPS))
        for label in labels if group in GROUPS else [group]:
            own[label].append(f"{group if group in GROUPS else kind}.{name}={value}")
    for label, name in labels.items() if controllers else ():
        own[label].append(f"controller.name={name if follow else controllers[0]}")
    return {label: Setup((planners or ())[0] if follow else name, own[label], robot) for label, name in labels.items()}
