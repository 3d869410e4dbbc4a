"""Skips for undeclared reasons are failures, so that no test is missing for want of a package."""

import subprocess
import sys

TESTS = {
    "test_module.py": "import pytest\npytest.importorskip('no_such_package')\n",
    "test_calls.py": """
import pytest
def test_data(): pytest.skip("needs BARN's worlds (docs/how-to/data.md)")
def test_package(): pytest.importorskip("no_such_package")
@pytest.mark.skipif(True, reason="no such package")
def test_mark(): pass
@pytest.mark.xfail(strict=True)
def test_wrong(): assert False
""",
}


def test_a_skip_for_want_of_a_package_fails(tmp_path):
    for name, text in TESTS.items():
        (tmp_path / name).write_text(text)
    words = ("-p", "tests.conftest", "-p", "no:cacheprovider", "-q", "-rN", "--continue-on-collection-errors")
    line = [sys.executable, "-m", "pytest", *words, "--rootdir", tmp_path, tmp_path]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    assert done.returncode == 1, done.stdout
    assert done.stdout.splitlines()[-1].startswith("1 failed, 1 skipped, 1 xfailed, 2 errors"), done.stdout
    assert done.stdout.count("not in MAY_SKIP of tests/conftest.py") == 3
