"""The process in which stages run returns pictures to the system, and its children end with it."""

import ctypes
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from humanmm.tasks.units.process import in_processes

TESTS = Path(__file__).resolve().parents[2]

PINNED = """
import numpy as np, sys
if sys.argv[1] == "prepared":
    from humanmm.tasks.units.process import prepare_process
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


@pytest.mark.parametrize("prepare", ["prepare_process()", "single_threaded(print_threads)()"])
def test_a_program_that_has_loaded_numpy_uses_one_thread_for_small_matrices(prepare: str) -> None:
    program = f"""
import numpy
from threadpoolctl import threadpool_info
from humanmm.machine import single_threaded
from humanmm.tasks.units.process import prepare_process
def print_threads():
    print(*(library["num_threads"] for library in threadpool_info()))
{prepare}
print_threads()
"""
    threads = {f"{library}_NUM_THREADS": "2" for library in ("OMP", "OPENBLAS", "MKL")}
    run = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, env=os.environ | threads
    )
    assert "1" in run.stdout.splitlines()[0] and "2" not in run.stdout.splitlines()[0]


def test_work_in_processes_comes_back_with_its_number() -> None:
    answers = dict(in_processes(divmod, [(7, 2), (9, 4), (5, 5)], 2))
    assert answers == {0: (3, 1), 1: (2, 1), 2: (1, 0)}


def test_an_error_in_one_process_ends_the_work() -> None:
    with pytest.raises(ZeroDivisionError):
        list(in_processes(divmod, [(1, 0), (1, 1)], 2))


_WAITS = """
import os, sys, time
from humanmm.tasks.units.process import in_processes


def told(path):
    with open(path, "w") as stream:
        stream.write(str(os.getpid()))
    time.sleep(600)

if __name__ == "__main__":
    list(in_processes(told, [(path,) for path in sys.argv[1:]], 2))
"""


@pytest.mark.parametrize("system", ["here", "no_linux"])
def test_processes_end_with_the_one_that_started_them_even_when_it_is_killed(tmp_path: Path, system: str) -> None:
    (tmp_path / "waits.py").write_text(_WAITS, encoding="utf-8")
    message = [tmp_path / "first", tmp_path / "second"]
    path = os.pathsep.join([*([str(TESTS / system)] if system == "no_linux" else []), str(TESTS.parent / "src")])
    parent = subprocess.Popen([sys.executable, tmp_path / "waits.py", *message], env={**os.environ, "PYTHONPATH": path})

    def until(holds: Callable[[], bool]) -> None:
        end = time.monotonic() + 60
        while not holds():
            assert time.monotonic() < end
            time.sleep(0.05)

    until(lambda: all(path.is_file() and path.read_text() for path in message))
    children = [int(path.read_text()) for path in message]
    parent.kill()
    parent.wait()
    until(lambda: not any(_runs(child) for child in children))


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "malloc_info"), reason="glibc alone says how many heaps it has")
def test_many_threads_share_heaps(tmp_path: Path) -> None:
    """In a process of its own: heaps that are there stay."""
    script = """
import ctypes, sys, threading
from humanmm.tasks.units.process import share_heaps

if int(sys.argv[2]):
    share_heaps(int(sys.argv[2]))
barrier = threading.Barrier(9)

def work():
    kept = [bytearray(100_000) for _ in range(3)]
    barrier.wait()
    barrier.wait()

threads = [threading.Thread(target=work) for _ in range(8)]
for thread in threads:
    thread.start()
barrier.wait()
libc = ctypes.CDLL(None)
libc.fopen.restype = ctypes.c_void_p
report = ctypes.c_void_p(libc.fopen(sys.argv[1].encode(), b"w"))
libc.malloc_info(0, report)
libc.fclose(report)
barrier.wait()
"""
    heaps = {}
    for limit in (0, 2):
        report = tmp_path / f"{limit}.xml"
        subprocess.run([sys.executable, "-c", script, str(report), str(limit)], check=True)
        heaps[limit] = report.read_text().count("<heap nr=")
    assert heaps[2] <= 2 < heaps[0]
