"""What the machine says of its processes, by /proc and, as on macOS, by ps alone."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from humanmm import machine


@pytest.fixture(params=["proc", "ps"])
def way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    if request.param == "ps":
        monkeypatch.setattr(machine, "PROC", Path("/nowhere"))
    return str(request.param)


@pytest.mark.usefixtures("way")
def test_a_living_process_is_told_from_one_that_has_ended_also_before_it_is_waited_for() -> None:
    with subprocess.Popen(["cat"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0) as child:
        try:
            _wait_for_its_answer(child)
            began = machine.started(child.pid)
            assert began is not None and machine.is_alive(child.pid)
            assert machine.started(child.pid) == began
            assert b"cat" in machine.command_line(child.pid)
        finally:
            child.kill()
        deadline = time.monotonic() + 10
        while machine.is_alive(child.pid):
            assert time.monotonic() < deadline
            time.sleep(0.01)
    assert machine.started(child.pid) is None and machine.age_s(child.pid) is None
    assert machine.command_line(child.pid) == b""


def _wait_for_its_answer(child: subprocess.Popen[bytes]) -> None:
    """A process has no command line for a moment after it was started; one that answers has."""
    assert child.stdin is not None and child.stdout is not None
    child.stdin.write(b"are you there\n")
    assert child.stdout.readline() == b"are you there\n"


def test_the_age_of_a_process_grows_with_time(way: str) -> None:
    before = machine.age_s(os.getpid())
    time.sleep(0.3)
    after = machine.age_s(os.getpid())
    assert before is not None and after is not None and 0.1 < after - before < 5
    assert after > 0 and (way == "proc" or before > -1), "ps counts whole seconds"


def test_memory_threads_and_processors_are_numbers_wherever_they_are_known(way: str) -> None:
    assert 10 < machine.resident_mb() < 100_000
    assert machine.peak_memory_mb() > 0.9 * machine.resident_mb() * 1e6 / 2**20
    assert machine.num_threads(os.getpid()) >= 1 and machine.num_processors() >= 1
    available = machine.available_bytes()
    assert (available is None) == (way == "ps") and (available or 1) > 0


def test_the_machine_has_one_name_for_all_its_processes() -> None:
    other = subprocess.run(
        [sys.executable, "-c", "from humanmm.machine import machine_name; print(machine_name())"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert other.stdout.strip() == machine.machine_name()


def test_a_name_that_begins_with_a_tilde_and_is_no_users_is_that_name() -> None:
    assert machine.expanded(Path("~/film.mp4")) == Path.home() / "film.mp4"
    assert machine.expanded(Path("~nobody-here.mp4")) == Path("~nobody-here.mp4")
