"""The process in which stages run gives pictures back to the system."""

import subprocess
import sys

import pytest

PINNED = """
import numpy as np, sys
if sys.argv[1] == "prepared":
    from humanmm.tasks.process import prepare_process
    prepare_process()
def picture():
    return np.ones(1000 * 1000 * 3, np.uint8)
picture()  # freed once: from now on glibc takes blocks of this size from its heap
pictures = [picture() for _ in range(60)]
result = np.ones(20_000)  # the end of the heap is in use from now on
del pictures
resident = [line for line in open("/proc/self/status") if line.startswith("VmRSS")][0]
print(int(resident.split()[1]) // 1024)
"""


def resident_mb(how: str) -> int:
    run = subprocess.run([sys.executable, "-c", PINNED, how], capture_output=True, text=True, check=True)
    return int(run.stdout)


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc/self/status")
def test_pictures_that_are_dropped_are_given_back() -> None:
    assert resident_mb("prepared") < resident_mb("as it is") - 100  # of 180 MB of pictures
