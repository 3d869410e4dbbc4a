"""`antdrive worlds generate`."""

from pathlib import Path

import pytest

from antdrive.worlds import load_task
from tests.cli.calling import Call, Refused


@pytest.mark.parametrize("words", [["forest", "--set", "count=8"], ["barn", "--set", "fill=0.2"]])
def test_one_seed_generates_one_world(antdrive: Call, words: list[str]) -> None:
    for name in ("a.yaml", "b.yaml"):
        assert antdrive("worlds", "generate", *words, "--seed", "5", "-o", name)[0] == 0
    a, b = load_task("a.yaml"), load_task("b.yaml")
    assert a.world.obstacles == b.world.obstacles
    assert antdrive("worlds", "generate", *words, "--seed", "6", "-o", "c.yaml")[0] == 0
    assert load_task("c.yaml").world.obstacles != a.world.obstacles


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["worlds", "generate", "forest", "-o", "folder.mp4"], "folder.mp4: cannot be written (Is a directory)"),
        (["worlds", "generate", "desert", "-o", "w.yaml"], "forest"),
        (["worlds", "generate", "forest", "-o", "w.yaml", "--set", "cuont=3"], "count"),
        (["worlds", "generate", "forest", "-o", "w.yaml", "--set", "count=1000"], "no world with 1000"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_wrong_input_is_one_line_and_exit_code_2(refused: Refused, words: list[str], says: str, tmp_path: Path) -> None:
    (tmp_path / "folder.mp4").mkdir()
    assert says in refused(*words)
