"""What is said of wrong input, gathered in one snapshot a room; `pytest --force-regen` writes it anew."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import pytest
from pytest_regressions.data_regression import DataRegressionFixture

from antdrive.base import FieldError, InputError

#: Words of other libraries, which differ between their versions.
FOREIGN = re.compile(
    r"(not YAML: )(?!a tab|nested|a special).*|(not XML: ).*|(cannot be read: )(?!has |Pillow reads).*"
)


def said(call: Callable[[], object], folder: Path | None = None) -> str:
    """The one line that refuses a call, without the folder of its files."""
    with pytest.raises((InputError, FieldError)) as caught:
        call()
    message = str(caught.value)
    assert message.isprintable()
    assert len(message) < 400
    if folder is not None:
        message = message.replace(f"{folder}/", "").replace(str(folder), "FOLDER")
    return FOREIGN.sub(lambda found: f"{found[1] or found[2] or found[3]}...", message)


def numbered(calls: Iterable[Callable[[], object]]) -> dict[str, Callable[[], object]]:
    """Calls without names."""
    return {f"#{number}": call for number, call in enumerate(calls)}


def check_messages(
    calls: Mapping[str, Mapping[str, Callable[[], object]]],
    data_regression: DataRegressionFixture,
    folder: Path | None = None,
) -> None:
    """Compare what is said of calls, by kind and name, with the room's snapshot."""
    found = {kind: {name: said(call, folder) for name, call in some.items()} for kind, some in calls.items()}
    data_regression.check(found, basename="messages")
