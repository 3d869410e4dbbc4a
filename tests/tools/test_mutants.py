"""Mutants: each kind of fault, the choice among them, the tables, and a run on a small project."""

import json
import os
import signal
import subprocess
import sys

import pytest

from tools.mutants.__main__ import as_text, counts, judged, stamp
from tools.mutants.operators import Mutant, mutants_of
from tools.mutants.plans import PLANS, ROOT, StaleTable, check_tables, drawn, named_mutants
from tools.mutants.running import SOURCE, BaselineUnfit, Copy, Ended, Processes, Server, dependents

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


def changes(source):
    return {(mutant.operator, mutant.now) for mutant in mutants_of("f.py", source)}


KINDS = {
    "constant": (
        "LIMIT = 5.0  # [m]",
        "LIMIT = 0.05  # [m]",
        "def f(a: int, b: float = 20.0) -> float:",
        "if a < 30 and not b:",
    ),
    "comparison": ("if a <= 3 and not b:", "if a >= 3 and not b:"),
    "logic": ("if a < 3 or not b:",),
    "condition dropped": ("if True and not b:", "if a < 3 and True:"),
    "sign dropped": ("if a < 3 and b:", "return min(a, b)"),
    "guard removed": ("if False:",),
    "condition negated": ("if not (a < 3 and not b):",),
    "opposite function": ("return -max(a, b)",),
    "argument alone": ("return -a",),
    "arithmetic": ("out[0] = a / (", "+ 1"),
    "term dropped": ("out[0] = a",),
    "statement deleted": ("pass",),
}


@pytest.mark.parametrize(("operator", "now"), [(kind, now) for kind, changed in KINDS.items() for now in changed])
def test_each_kind_of_fault_is_made(operator, now):
    assert (operator, now) in changes(TEXT)


def test_texts_types_and_messages_are_left_alone():
    for mutant in mutants_of("f.py", TEXT):
        assert compile(mutant.source, "f.py", "exec")
        assert "A docstring with 1.0 in it." in mutant.source
        assert "f(a: int, b: float" in mutant.source
        assert 'f"{a + 1}"' in mutant.source or mutant.operator == "statement deleted"
        assert mutant.source != TEXT
    assert len({mutant.source for mutant in mutants_of("f.py", TEXT)}) == len(mutants_of("f.py", TEXT))


def test_letters_of_several_bytes_do_not_shift_an_edit():
    assert ("comparison", "x = 'ä≤ö', 1 <= 2") in changes("x = 'ä≤ö', 1 < 2\n")


def test_the_choice_is_repeatable_and_gives_every_function_its_share():
    file = "sim/log/contacts.py"
    first = drawn(file, 12)
    assert first == drawn(file, 12)
    assert first != drawn(file, 12, seed=2)
    assert len(first) == 12
    everything = {mutant.function for mutant in drawn(file, 10_000)}
    assert {mutant.function for mutant in first} == everything


def test_every_table_speaks_of_code_that_exists():
    check_tables()
    assert sum(plan.count for plan in PLANS.values()) + len(named_mutants()) >= 150


def test_a_snippet_that_its_file_no_longer_holds_is_an_error(tmp_path):
    for mutant in named_mutants():
        target = tmp_path / SOURCE / mutant.file
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text((ROOT / SOURCE / mutant.file).read_text())
    assert len(named_mutants(tmp_path)) == len(named_mutants())
    ending = tmp_path / SOURCE / "sim/log/ending.py"
    ending.write_text(ending.read_text().replace("AFTER_CONTACT = 0.5", "AFTER_CONTACT = 1.0"))
    with pytest.raises(StaleTable, match=r"0\.05 s logged after a contact: .* occurs 0 times in sim/log/ending\.py"):
        named_mutants(tmp_path)


def test_what_depends_on_a_kernel_is_found_also_through_packages():
    found = dependents(ROOT, "robots/control/_kernels_path.py")
    assert {"robots/control/_kernels_pursuit.py", "robots/control/pursuit.py", "sim/driving/drive.py"} <= found
    assert not {"worlds/_kernels.py", "planners/graph/_kernels_search.py", "robots/_kernels_footprint.py"} & found
    assert "robots/_kernels_footprint.py" in dependents(ROOT, "worlds/_kernels.py")


def test_the_score_leaves_equivalent_and_unjudged_mutants_out():
    mutant = Mutant("f.py", "constant", "f", 3, "a = 1", "a = 2", "")
    fates = [(mutant, fate) for fate in ("killed", "killed", "timeout", "equivalent", "alive", "unjudged", "unjudged")]
    assert counts(fates)["score"] == 0.75
    assert counts([])["score"] is None
    text = as_text({"f.py": fates})
    assert "| `f.py` | 7 | 3 | 1 | 1 | 1 | 2 | 75 % |" in text
    assert text.splitlines()[-2:] == ["alive: 1", "f.py:3 [constant] a = 1  ->  a = 2"]


@pytest.fixture(scope="module")
def ends(tmp_path_factory):
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
def test_the_server_tells_a_failure_from_a_time_limit(ends, kind, code):
    assert ends[kind][0] == code


def test_an_unfit_baseline_says_why(ends):
    assert Ended(1, 0.1, ends["fails"][1]).reason.startswith("fail: ")
    assert Ended(1, 0.1, ends["fails"][1]).reason.endswith("test_1.py::test_it")
    assert Ended(5, 0.1, ends["holds none"][1]).reason == "hold no test"
    assert Ended(None, 600.0, "").reason == "do not end within their time limit"
    assert Ended(-11, 0.1, "").reason == "end with signal 11"


def fates_of(tmp_path, monkeypatch, codes):
    """What becomes of three mutants of a file when its tests end so: first without a fault, then with each."""
    file = tmp_path / "original" / SOURCE / "sim/log/metrics.py"
    for path in (file, tmp_path / "original" / SOURCE / "base/kernel_cache.py"):
        path.parent.mkdir(parents=True)
        path.write_text("a = 1\n")
    ends = iter(codes)
    failed = "FAILED tests/test_a.py::test_it - no"
    monkeypatch.setattr(Server, "_start", lambda self: None)
    monkeypatch.setattr(Server, "end", lambda self: None)
    monkeypatch.setattr(Server, "run", lambda *_: Ended(next(ends), 1.0, failed))
    copy = Copy(tmp_path / "original", tmp_path / "copy", Processes())
    mutants = [Mutant("sim/log/metrics.py", "constant", "", 1, "a = 1", f"a = {n}", f"a = {n}\n") for n in (2, 3, 4)]
    fates = [fate for _, fate in copy.fates(mutants, PLANS["sim/log/metrics.py"])]
    assert (tmp_path / "copy" / SOURCE / "sim/log/metrics.py").read_text() == "a = 1\n"
    return fates


def test_a_mutant_is_killed_by_a_failure_a_signal_or_the_time_limit_and_else_alive(tmp_path, monkeypatch):
    assert fates_of(tmp_path / "a", monkeypatch, [0, 1, 0, None]) == ["killed", "alive", "timeout"]
    assert fates_of(tmp_path / "b", monkeypatch, [0, -11, 3, 2]) == ["killed"] * 3
    assert (
        fates_of(tmp_path / "c", monkeypatch, [0, 4, 5, 1]) == ["killed"] * 3
    )  # 4: not even conftest.py can be loaded


@pytest.mark.parametrize(("code", "says"), [(1, "fail: tests/test_a.py::test_it"), (None, "do not end within their")])
def test_tests_that_fail_on_the_unchanged_code_judge_nothing(tmp_path, monkeypatch, code, says):
    with pytest.raises(BaselineUnfit, match=f"metrics.py: on the unchanged code its tests {says}"):
        fates_of(tmp_path, monkeypatch, [code])


def test_what_is_known_already_is_not_judged_again(tmp_path):
    file, store = "sim/log/metrics.py", tmp_path / "fates.jsonl"
    fates = list(zip(drawn(file, 3), ("killed", "alive", "timeout"), strict=True))
    store.write_text("".join(json.dumps([*mutant.key, stamp(file), fate]) + "\n" for mutant, fate in fates))
    assert judged({file: drawn(file, 3)}, 1, store) == {file: fates}
