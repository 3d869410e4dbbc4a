"""Mutants: the plans, the choice among them, and a run on a small project."""

import pytest

from tools import mutants
from tools.mutants import FAULT, PLANS, ROOT, SOURCE, Fate, Fault, StalePlan, chosen, judged, report


def test_every_plan_speaks_of_code_that_exists():
    for file, plan in PLANS.items():
        names = (SOURCE / file, *(f"tests/{test}" for test in plan["tests"]))
        assert [name for name in names if not (ROOT / name).is_file()] == []
        source = (ROOT / SOURCE / file).read_text()
        assert [fault["name"] for fault in plan.get("faults", ()) if source.count(fault["was"]) != 1] == []


def keys(items):
    """Operator and place of each mutant, whose names are drawn anew each time."""
    return [(one.mutations[0].operator_name, one.mutations[0].start_pos, one.mutations[0].occurrence) for one in items]


def test_the_choice_is_repeatable_has_all_faults_and_gives_every_function_its_share(monkeypatch):
    monkeypatch.chdir(ROOT)
    file = "sim/driving/rules.py"
    first = chosen(file)
    assert keys(first) == keys(chosen(file)) != keys(chosen(file, seed=2))
    faults = [one for one in first if one.mutations[0].operator_name == FAULT]
    assert len(faults) == len(PLANS[file]["faults"])
    assert len(first) == len(faults) + PLANS[file]["count"]
    functions = [one.mutations[0].definition_name for one in first if one not in faults]
    assert len(set(functions)) == len(functions)


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A project of one file with its tests; returns what becomes of faults and drawn mutants."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / SOURCE).mkdir(parents=True)
    (tmp_path / "tests").mkdir()
    (tmp_path / SOURCE / "f.py").write_text("def f():\n    return 1  # sure\n")
    path = f"import sys\nsys.path.insert(0, {str(SOURCE)!r})\nfrom f import f\n"

    def fates(test, *changes, count=0, seed=1):
        (tmp_path / "tests" / "test_f.py").write_text(path + test)
        faults = [{"name": now or was, "was": was, "now": now} for was, now in changes]
        monkeypatch.setattr(mutants, "PLANS", {"f.py": {"tests": ["test_f.py"], "count": count, "faults": faults}})
        monkeypatch.setattr(mutants, "LEAST_TIME", 2.0)
        return judged("f.py", seed, tmp_path)

    return fates


def test_a_piece_that_the_file_has_not_once_is_an_error(project):
    with pytest.raises(StalePlan, match="2: its file has 'return 0' 0 times, must once"):
        project("def test_f(): assert f() == 1\n", ("return 0", "2"))


@pytest.mark.slow
def test_mutants_are_killed_by_a_failure_or_the_time_limit_and_else_alive(project):
    changes = [("return 1", "return 2"), ("return 1", "while True: pass"), ("  # sure", "")]
    found = {
        one.mutant.partition("[")[2].partition("]")[0]: one.fate
        for one in project("def test_f(): assert f() == 1\n", *changes)
    }
    assert found == {"return 2": "killed", "while True: pass": "timeout", "  # sure": "alive"}


@pytest.mark.slow
def test_tests_that_fail_on_the_unchanged_code_judge_nothing_and_a_session_goes_on(project, monkeypatch):
    (fate,) = project("def test_f(): assert f() == 2\n", ("return 1", "return 2"))
    assert fate.fate == "unjudged"
    assert "on the unchanged code its tests fail" in fate.mutant
    first = project("def test_f(): assert f()\n", count=2)
    assert sorted(one.fate for one in first) == ["alive", "killed"]  # 1 becomes 2, and 0
    monkeypatch.setattr(mutants, "run_tests", None)
    assert project("def test_f(): assert f()\n", count=2) == first


def test_the_score_leaves_unjudged_mutants_out():
    fates = [Fate(fate, f"f.py:3 {fate}") for fate in ("killed", "killed", "timeout", "alive", "unjudged")]
    lines = list(report({"f.py": fates}))
    assert "| `f.py` | 5 | 3 | 1 | 1 | 1 | 75 % |" in lines
    assert lines[-2:] == ["alive: f.py:3 alive", "unjudged: f.py:3 unjudged"]


def test_a_fault_is_declared_as_the_library_declares_operators():
    assert {one.name for one in Fault.arguments()} == {"name", "was", "now"}
