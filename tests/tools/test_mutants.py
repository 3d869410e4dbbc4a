"""Mutants: each kind of fault, the choice among them, the tables, and a run on a small project."""

from __future__ import annotations

from pathlib import Path

import pytest

from tools.mutants.__main__ import as_text, counts
from tools.mutants.operators import Mutant, mutants_of
from tools.mutants.plans import PLANS, ROOT, StaleTable, check_tables, drawn, named_mutants
from tools.mutants.running import dependents

SOURCE = '''"""A docstring with 1.0 in it."""
LIMIT = 0.5  # [m]


def f(a: int, b: float = 2.0) -> float:
    """Text."""
    if a < 3 and not b:
        return -min(a, b)
    out[0] = a * (
        b  # a comment
        - 1
    )
    raise ValueError(f"{a + 1}")
'''


def changes(source: str) -> set[tuple[str, str]]:
    return {(mutant.operator, mutant.now) for mutant in mutants_of("f.py", source)}


@pytest.mark.parametrize(
    ("operator", "now"),
    [
        ("constant", "LIMIT = 5.0  # [m]"),
        ("constant", "LIMIT = 0.05  # [m]"),
        ("constant", "def f(a: int, b: float = 20.0) -> float:"),
        ("comparison", "if a <= 3 and not b:"),
        ("comparison", "if a >= 3 and not b:"),
        ("constant", "if a < 30 and not b:"),
        ("logic", "if a < 3 or not b:"),
        ("condition dropped", "if True and not b:"),
        ("condition dropped", "if a < 3 and True:"),
        ("sign dropped", "if a < 3 and b:"),
        ("guard removed", "if False:"),
        ("condition negated", "if not (a < 3 and not b):"),
        ("opposite function", "return -max(a, b)"),
        ("argument alone", "return -a"),
        ("sign dropped", "return min(a, b)"),
        ("arithmetic", "out[0] = a / ("),
        ("arithmetic", "+ 1"),
        ("term dropped", "out[0] = a"),
        ("statement deleted", "pass"),
    ],
)
def test_each_kind_of_fault_is_made(operator: str, now: str) -> None:
    assert (operator, now) in changes(SOURCE)


def test_texts_types_and_messages_are_left_alone() -> None:
    for mutant in mutants_of("f.py", SOURCE):
        assert compile(mutant.source, "f.py", "exec")
        assert "A docstring with 1.0 in it." in mutant.source
        assert "f(a: int, b: float" in mutant.source
        assert 'f"{a + 1}"' in mutant.source or mutant.operator == "statement deleted"
        assert mutant.source != SOURCE
    assert len({mutant.source for mutant in mutants_of("f.py", SOURCE)}) == len(mutants_of("f.py", SOURCE))


def test_letters_of_several_bytes_do_not_shift_an_edit() -> None:
    assert ("comparison", "x = 'ä≤ö', 1 <= 2") in changes("x = 'ä≤ö', 1 < 2\n")


def test_the_choice_is_repeatable_and_gives_every_function_its_share() -> None:
    file = "sim/log/contacts.py"
    first = drawn(file, 12)
    assert first == drawn(file, 12)
    assert first != drawn(file, 12, seed=2)
    assert len(first) == 12
    everything = {mutant.function for mutant in drawn(file, 10_000)}
    assert {mutant.function for mutant in first} == everything


def test_every_table_speaks_of_code_that_exists() -> None:
    check_tables()
    assert sum(plan.count for plan in PLANS.values()) + len(named_mutants()) >= 150


def test_a_snippet_that_its_file_no_longer_holds_is_an_error(tmp_path: Path) -> None:
    for mutant in named_mutants():
        target = tmp_path / mutant.file
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text((ROOT / mutant.file).read_text())
    assert len(named_mutants(tmp_path)) == len(named_mutants())
    (tmp_path / "sim/driving/drive.py").write_text("AFTER_CONTACT = 1.0\n")
    with pytest.raises(StaleTable, match=r"0\.05 s logged after a contact: .* occurs 0 times in sim/driving/drive\.py"):
        named_mutants(tmp_path)


def test_what_depends_on_a_kernel_is_found_also_through_packages() -> None:
    found = dependents(ROOT, "robots/control/_kernels_path.py")
    assert {"robots/control/_kernels_pursuit.py", "robots/control/pursuit.py", "sim/driving/drive.py"} <= found
    assert not {"worlds/_kernels.py", "planners/graph/_kernels_search.py", "robots/_kernels_footprint.py"} & found
    assert "robots/_kernels_footprint.py" in dependents(ROOT, "worlds/_kernels.py")


def test_the_score_leaves_equivalent_mutants_out() -> None:
    mutant = Mutant("f.py", "constant", "f", 3, "a = 1", "a = 2", "")
    fates = [(mutant, fate) for fate in ("killed", "killed", "timeout", "equivalent", "alive")]
    assert counts(fates)["score"] == 0.75
    assert counts([])["score"] is None
    text = as_text({"f.py": fates})
    assert "| `f.py` | 5 | 3 | 1 | 1 | 1 | 75 % |" in text
    assert text.splitlines()[-2:] == ["alive: 1", "f.py:3 [constant] a = 1  ->  a = 2"]
