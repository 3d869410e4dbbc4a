"""Tables and JSON as they are printed."""

import json
import math
import sys

import numpy as np
import pytest

from antdrive.cli.console import as_json
from tests.cli.calling import Call


def test_a_table_is_no_wider_than_the_terminal(antdrive: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    full = antdrive("worlds", "list")[1].splitlines()
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "90")
    cut = antdrive("worlds", "list")[1].splitlines()
    assert max(map(len, full)) > 90
    assert cut == [line if len(line) <= 90 else line[:89] + "…" for line in full]


def test_json_holds_null_where_a_number_is_not_finite() -> None:
    value = {"a": math.inf, "b": [math.nan, np.float64(1.5)], 3: (np.int64(2), None)}
    assert json.loads(as_json(value)) == {"a": None, "b": [None, 1.5], "3": [2, None]}
