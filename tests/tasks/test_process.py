"""The process in which stages run gives pictures back to the system."""

import subprocess
import sys

import pytest

FRAGMENT = """
import numpy as np, sys
if sys.argv[1] == "prepared":
    from humanmm.tasks.process import prepare_process
    prepare_process()
kept, recent = [], []
for k in range(150):
    recent = [*recent[-8:], np.ones(1700 * 1000 * 3, np.uint8)]
    kept.append([np.ones(300) for _ in range(40)])
peak = [line for line in open("/proc/self/status") if line.startswith("VmHWM")][0]
print(int(peak.split()[1]) // 1024)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc/self/status")
def test_pictures_that_are_dropped_leave_no_holes_in_memory() -> None:
    run = subprocess.run([sys.executable, "-c", FRAGMENT, "prepared"], capture_output=True, text=True, check=True)
    assert int(run.stdout) < 200  # 10 pictures of 5 MB, 15 MB kept, and Python with numpy
