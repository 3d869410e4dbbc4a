"""A version of numba that nobody tried: plain machine code, and a line that says so."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from antdrive.base import _kernels_compiler

ROOT = Path(__file__).parents[2]

# numba claims to be another version; inner parts that a later version may lack are out of reach.
FORGED = """
import sys
import numba
numba.__version__ = "0.{minor}.0"
numba.version_info = numba.version_info._replace(short=(0, {minor}))
sys.modules["antdrive.base._kernels_dispatcher"] = sys.modules["antdrive.base._kernels_interpreter"] = None
from antdrive.worlds._kernels import segment_distance2
print(segment_distance2(1.0, 2.0, 0.0, 0.0, 4.0, 0.5), type(segment_distance2).__name__)
"""


@pytest.mark.skipif(bool(os.environ.get("NUMBA_DISABLE_JIT")), reason="needs compiled kernels")
@pytest.mark.parametrize("minor", [59, 69])
def test_kernels_compile_in_the_plain_way(minor, tmp_path):
    from antdrive.worlds._kernels import segment_distance2

    env = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    for _ in range(2):
        code = FORGED.format(minor=minor)
        done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, check=False)
        assert done.stderr == (
            f"antdrive: numba 0.{minor}.0 is untried: every kernel compiles at its first call. "
            "Remedy: pip install 'numba>=0.60,<0.69'\n"
        )
        assert done.stdout.split() == [repr(segment_distance2(1.0, 2.0, 0.0, 0.0, 4.0, 0.5)), "CPUDispatcher"]
        entries = list(tmp_path.glob("antdrive-*/**/*.nbc"))
        assert entries
        assert len({path.stat().st_mtime_ns for path in entries}) == len(entries)


def test_the_package_demands_the_tried_versions():
    (demand,) = [
        line.strip().strip('",')
        for line in (ROOT / "pyproject.toml").read_text(encoding="utf-8").splitlines()
        if line.strip().startswith('"numba')
    ]
    (low, high) = (f"{major}.{minor}" for major, minor in _kernels_compiler.TRIED)
    assert demand.startswith(f"numba>={low},<{high}")
