"""Error messages on invalid input, one snapshot per room; `pytest --force-regen` rewrites it."""

import re

import pytest

from antdrive.base import FieldError, InputError

#: Words of other libraries, which differ between their versions.
FOREIGN = re.compile(
    r"(not YAML: )(?!a tab|nested|a special).*|(not XML: ).*|(cannot be read: )(?!has |Pillow reads).*"
    r"|(not a rollout)(?: \((?:\('|Cannot parse|EOF|File is not|zip file)|: t is).*"
    r"|(cannot be read \()(?!larger).*"
)


def said(call, folder=None):
    """The one line that refuses a call, without the folder of its files."""
    with pytest.raises((InputError, FieldError)) as caught:
        call()
    message = str(caught.value)
    assert message.isprintable()
    assert len(message) < 400
    if folder is not None:
        message = message.replace(f"{folder}/", "").replace(str(folder), "FOLDER")
    return FOREIGN.sub(lambda found: f"{next(filter(None, found.groups()))}...", message)


def numbered(calls):
    """Calls without names."""
    return {f"#{number}": call for number, call in enumerate(calls)}


def check_messages(calls, data_regression, folder=None):
    """Compare what is said of calls, by kind and name, with the room's snapshot."""
    found = {kind: {name: said(call, folder) for name, call in some.items()} for kind, some in calls.items()}
    data_regression.check(found, basename="messages")
