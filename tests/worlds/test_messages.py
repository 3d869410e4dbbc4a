"""What is said of wrong worlds, in files of every format and in Python: all of it is in `test_messages.yml`."""

from __future__ import annotations

from pathlib import Path

import pytest
from pytest_regressions.data_regression import DataRegressionFixture

from antdrive.worlds import (
    import_dynabarn,
    import_map_server,
    import_movingai_map,
    import_movingai_problems,
    import_sdf,
    load_task,
)
from tests.messages import check_messages, numbered
from tests.worlds.files.test_world_file import write
from tests.worlds.formats import test_dynabarn, test_map_server, test_movingai, test_sdf
from tests.worlds.malformed import MALFORMED
from tests.worlds.test_movers import WRONG


def test_wrong_worlds_are_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, data_regression: DataRegressionFixture
) -> None:
    monkeypatch.chdir(tmp_path)

    def served(text: str, image: bytes | None) -> object:
        for old in tmp_path.glob("made.*"):
            old.unlink()
        return import_map_server(
            test_map_server.written(tmp_path, text, image), start=(-0.7, 2.2, 0.0), goal=(0.2, 2.2)
        )

    def sdf(text: str) -> object:
        (tmp_path / "bad.world").write_text(text)
        return import_sdf(tmp_path / "bad.world")

    octile, sets, models = test_movingai.written, test_dynabarn.written, test_sdf.world
    problems = [
        "",
        "version 2\n",
        test_movingai.PROBLEM,
        *(f"version 1\n{line}\n" for line in test_movingai.BAD_PROBLEMS),
    ]
    calls = {
        "world files": {name: lambda c=c: load_task(write(tmp_path, c)) for name, c in MALFORMED.items()},
        "map_server": {name: lambda c=c: served(*c) for name, c in test_map_server.BAD.items()},
        "movingai maps": numbered(lambda c=c: import_movingai_map(octile(tmp_path, c)) for c in test_movingai.BAD_MAPS),
        "movingai problems": numbered(lambda c=c: import_movingai_problems(octile(tmp_path, c)) for c in problems),
        "dynabarn": numbered(lambda c=c: import_dynabarn(sets(tmp_path, c)) for c in test_dynabarn.BAD),
        "sdf models": {
            name: lambda c=c: test_sdf.discs(models(tmp_path, c)) for name, c in test_sdf.UNSUPPORTED.items()
        },
        "sdf files": {name: lambda c=c: sdf(c) for name, c in test_sdf.BAD_XML.items()},
        "movers": numbered(WRONG),
    }
    check_messages(calls, data_regression, tmp_path)
