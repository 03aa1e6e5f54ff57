"""Memory that large arrays give back."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

SCRIPT = """
import resource, sys
import numpy as np
from persfs_cl.cli.memory import keep_freed_memory
if sys.argv[1] == "keep":
    keep_freed_memory()
values = np.ones(400_000)
for _ in range(3):
    values + 1.0
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(50):
    values + 1.0, values - 1.0, np.sqrt(np.abs(values))
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc is asked to keep memory")
def test_later_arrays_take_the_memory_of_earlier_ones() -> None:
    def faults(how: str) -> int:
        done = subprocess.run([sys.executable, "-c", SCRIPT, how], capture_output=True, text=True, check=True)
        return int(done.stdout)

    # Four arrays at a time, of 782 pages each, once and not 50 times.
    assert faults("keep") < 10 * 782
