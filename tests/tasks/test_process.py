"""The process in which stages run gives pictures back to the system, and knows work that can wait."""

import os
import subprocess
import sys
import threading

import pytest

from humanmm.tasks.process import in_spare_time

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


def test_work_in_spare_time_gives_its_result_and_leaves_the_caller_its_priority() -> None:
    before = os.getpriority(os.PRIO_PROCESS, threading.get_native_id())
    within = in_spare_time(lambda: os.getpriority(os.PRIO_PROCESS, threading.get_native_id()))
    assert os.getpriority(os.PRIO_PROCESS, threading.get_native_id()) == before
    assert within == (19 if sys.platform == "linux" else before)


def test_an_error_in_spare_time_is_the_callers() -> None:
    with pytest.raises(ZeroDivisionError):
        in_spare_time(lambda: 1 // 0)
