"""Mutants: each kind of fault, the choice among them, the tables, and a run on a small project."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tools.mutants.__main__ import as_text, counts, judged
from tools.mutants.operators import Mutant, mutants_of
from tools.mutants.plans import PLANS, ROOT, StaleTable, check_tables, drawn, named_mutants
from tools.mutants.results import Results, ResultsUnfit, digest
from tools.mutants.running import SOURCE, BaselineUnfit, Copy, Ended, Server, dependents

TEXT = '''"""A docstring with 1.0 in it."""
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
    assert (operator, now) in changes(TEXT)


def test_texts_types_and_messages_are_left_alone() -> None:
    for mutant in mutants_of("f.py", TEXT):
        assert compile(mutant.source, "f.py", "exec")
        assert "A docstring with 1.0 in it." in mutant.source
        assert "f(a: int, b: float" in mutant.source
        assert 'f"{a + 1}"' in mutant.source or mutant.operator == "statement deleted"
        assert mutant.source != TEXT
    assert len({mutant.source for mutant in mutants_of("f.py", TEXT)}) == len(mutants_of("f.py", TEXT))


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
        target = tmp_path / SOURCE / mutant.file
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text((ROOT / SOURCE / mutant.file).read_text())
    assert len(named_mutants(tmp_path)) == len(named_mutants())
    (tmp_path / SOURCE / "sim/driving/drive.py").write_text("AFTER_CONTACT = 1.0\n")
    with pytest.raises(StaleTable, match=r"0\.05 s logged after a contact: .* occurs 0 times in sim/driving/drive\.py"):
        named_mutants(tmp_path)


def test_what_depends_on_a_kernel_is_found_also_through_packages() -> None:
    found = dependents(ROOT, "robots/control/_kernels_path.py")
    assert {"robots/control/_kernels_pursuit.py", "robots/control/pursuit.py", "sim/driving/drive.py"} <= found
    assert not {"worlds/_kernels.py", "planners/graph/_kernels_search.py", "robots/_kernels_footprint.py"} & found
    assert "robots/_kernels_footprint.py" in dependents(ROOT, "worlds/_kernels.py")


def test_the_score_leaves_equivalent_and_unjudged_mutants_out() -> None:
    mutant = Mutant("f.py", "constant", "f", 3, "a = 1", "a = 2", "")
    fates = [(mutant, fate) for fate in ("killed", "killed", "timeout", "equivalent", "alive", "unjudged", "unjudged")]
    assert counts(fates)["score"] == 0.75
    assert counts([])["score"] is None
    text = as_text({"f.py": fates})
    assert "| `f.py` | 7 | 3 | 1 | 1 | 1 | 2 | 75 % |" in text
    assert text.splitlines()[-2:] == ["alive: 1", "f.py:3 [constant] a = 1  ->  a = 2"]


@pytest.fixture(scope="module")
def ends(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[int, str]]:
    """How the server says that tests of several kinds ended: its code and what pytest printed."""
    folder = tmp_path_factory.mktemp("tests")
    kinds = {
        "passes": "def test_it(): pass",
        "fails": "def test_it(): assert 1 + 1 == 3",
        "never ends": "def test_it():\n    while True: pass",
        "holds none": "it = 1",
        "dies": "import os\ndef test_it(): os.kill(os.getpid(), 9)",
    }
    (folder / "pytest.ini").write_text("[pytest]\n")
    lines = [json.dumps({"modules": ["pytest"], "changing": "no_such_module"})]
    for number, text in enumerate(kinds.values()):
        test, output = folder / f"test_{number}.py", folder / f"{number}.txt"
        test.write_text(text + "\n")
        arguments = ["-q", "-rfE", "--timeout=0", "-p", "no:cacheprovider", f"--rootdir={folder}", str(test)]
        lines.append(json.dumps({"arguments": arguments, "output": str(output), "limit": 1.0}))
    environment = {**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    command = [sys.executable, "-m", "tools.mutants.server"]
    done = subprocess.run(
        command, cwd=ROOT, env=environment, input="\n".join(lines), capture_output=True, text=True, check=True
    )
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    return {
        kind: (answer["code"], (folder / f"{number}.txt").read_text())
        for number, (kind, answer) in enumerate(zip(kinds, answers, strict=True))
    }


@pytest.mark.parametrize(
    ("kind", "code"), [("passes", 0), ("fails", 1), ("never ends", -signal.SIGXCPU), ("holds none", 5), ("dies", -9)]
)
def test_the_server_tells_a_failure_from_a_time_limit(ends: dict[str, tuple[int, str]], kind: str, code: int) -> None:
    assert ends[kind][0] == code


def test_an_unfit_baseline_says_why(ends: dict[str, tuple[int, str]]) -> None:
    assert Ended(1, 0.1, ends["fails"][1]).reason.startswith("fail: ")
    assert Ended(1, 0.1, ends["fails"][1]).reason.endswith("test_1.py::test_it")
    assert Ended(5, 0.1, ends["holds none"][1]).reason == "hold no test"
    assert Ended(None, 600.0, "").reason == "do not end within their time limit"
    assert Ended(-11, 0.1, "").reason == "end with signal 11"


class _Scripted(Server):
    """A server whose runs end as told."""

    def __init__(self, codes: list[int | None]) -> None:
        self.codes = codes

    def run(self, tests: tuple[str, ...], limit: float) -> Ended:
        return Ended(self.codes.pop(0), 1.0, "FAILED tests/test_a.py::test_it - no")

    def end(self) -> None: ...


class _Same(Copy):
    """A copy without files, whose server is scripted."""

    def __init__(self, original: Path, root: Path, codes: list[int | None]) -> None:
        self.root, self._original, self._codes = root, original, codes

    def server(self, *_: object) -> Server:
        return _Scripted(self._codes)


def fates_of(tmp_path: Path, codes: list[int | None]) -> list[str]:
    """What becomes of three mutants of a file when its tests end so: first without a fault, then with each."""
    for folder in ("original", "copy"):
        (tmp_path / folder / SOURCE / "sim/log").mkdir(parents=True)
        (tmp_path / folder / SOURCE / "sim/log/metrics.py").write_text("a = 1\n")
    copy = _Same(tmp_path / "original", tmp_path / "copy", codes)
    mutants = [Mutant("sim/log/metrics.py", "constant", "", 1, "a = 1", f"a = {n}", f"a = {n}\n") for n in (2, 3, 4)]
    fates = [fate for _, fate in copy.fates(mutants, PLANS["sim/log/metrics.py"])]
    assert (tmp_path / "copy" / SOURCE / "sim/log/metrics.py").read_text() == "a = 1\n"
    return fates


def test_a_mutant_is_killed_by_a_failure_a_signal_or_the_time_limit_and_else_alive(tmp_path: Path) -> None:
    assert fates_of(tmp_path, [0, 1, 0, None]) == ["killed", "alive", "timeout"]
    assert fates_of(tmp_path / "again", [0, -11, 3, 2]) == ["killed"] * 3
    assert fates_of(tmp_path / "third", [0, 4, 5, 1]) == ["killed"] * 3  # 4: not even conftest.py can be loaded


def test_tests_that_fail_on_the_unchanged_code_judge_nothing(tmp_path: Path) -> None:
    with pytest.raises(
        BaselineUnfit, match=r"metrics\.py: on the unchanged code its tests fail: tests/test_a\.py::test_it"
    ):
        fates_of(tmp_path, [1])
    with pytest.raises(BaselineUnfit, match="do not end within their time limit"):
        fates_of(tmp_path / "again", [None])


def results_project(root: Path) -> Mutant:
    """A project that holds the file of a mutant and its tests."""
    for name in (f"{SOURCE}/sim/log/metrics.py", *PLANS["sim/log/metrics.py"].files):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text("a = 1\n")
    digest.cache_clear()
    return Mutant("sim/log/metrics.py", "constant", "f", 1, "a = 1", "a = 2", "a = 2\n")


@pytest.mark.parametrize(("fate", "tests_changed", "file_changed"), [("killed", "killed", None), ("alive", None, None)])
def test_a_result_holds_as_long_as_nothing_changes_that_could_alter_it(
    tmp_path: Path, fate: str, tests_changed: str | None, file_changed: str | None
) -> None:
    mutant = results_project(tmp_path)
    store = tmp_path / "results" / "fates.jsonl"
    assert Results(store, tmp_path).fate(mutant) is None
    Results(store, tmp_path).add(mutant, fate)
    assert Results(store, tmp_path).fate(mutant) == fate
    (tmp_path / PLANS[mutant.file].files[0]).write_text("a = 2\n")
    digest.cache_clear()
    assert Results(store, tmp_path).fate(mutant) == tests_changed
    (tmp_path / SOURCE / mutant.file).write_text("b = 1\n")
    digest.cache_clear()
    assert Results(store, tmp_path).fate(mutant) == file_changed


def test_a_file_of_results_that_holds_something_else_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("nothing\n")
    with pytest.raises(ResultsUnfit, match=r"notes\.txt: line 1: not a result"):
        Results(tmp_path / "notes.txt")


def test_what_is_known_already_is_not_judged_again(tmp_path: Path) -> None:
    file = "sim/log/metrics.py"
    mutants, store = drawn(file, 3), Results(tmp_path / "fates.jsonl")
    for mutant, fate in zip(mutants, ("killed", "alive", "timeout"), strict=True):
        store.add(mutant, fate)
    fates = judged({file: mutants}, 1, Results(tmp_path / "fates.jsonl"))
    assert fates == {file: list(zip(mutants, ("killed", "alive", "timeout"), strict=True))}
