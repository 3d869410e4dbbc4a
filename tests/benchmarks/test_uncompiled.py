"""A benchmark says if it measured kernels without machine code."""

import pytest

from antdrive.base import kernel_cache
from benchmarks.markdown import report_uncompiled


@pytest.mark.parametrize(("compiled", "interpreted"), [([], 0), (["f"], 0), ([], 3)])
def test_a_line_says_what_was_compiled_or_ran_in_python(compiled, interpreted, monkeypatch, capsys):
    monkeypatch.setattr(kernel_cache, "interpreted", interpreted)
    report_uncompiled(compiled)
    said = capsys.readouterr().err
    assert bool(said) is bool(compiled or interpreted)
    assert not said or said.startswith(
        f"{len(compiled)} kernels compiled and {interpreted} calls of kernels ran in Python"
    )
