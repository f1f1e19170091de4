"""What this machine says of itself and of its processes: /proc on Linux, `ps` where there is none (macOS)."""

import contextlib
import os
import resource
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from functools import cache, wraps
from pathlib import Path
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

P = ParamSpec("P")
T = TypeVar("T")

PROC = Path("/proc")
_GONE = "ZX"
"""States of a process that has ended and is not yet forgotten."""


def num_processors() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def nvidia_devices() -> int:
    """Accelerators that NVIDIA's driver shows: its device files on Linux; on WSL there is a single one for all."""
    return len(list(Path("/dev").glob("nvidia[0-9]*"))) or len(list(Path("/dev").glob("dxg")))


@cache
def machine_name() -> str:
    """The same for all processes that see each other's numbers: the system since it was started, and its container."""
    try:
        boot = (PROC / "sys/kernel/random/boot_id").read_text().strip()
        return f"{boot}/{(PROC / 'self/ns/pid').stat().st_ino}"
    except OSError:  # no Linux, or a sandbox that hides them
        return socket.gethostname()


def started(pid: int) -> int | None:
    """When a living process was started, unlike that of a later one of the same number; None if there is none.

    Clock ticks since the system was started (proc(5), field 22 of /proc/PID/stat), or seconds since 1970.
    """
    if PROC.is_dir():
        try:
            state, *fields = (PROC / str(pid) / "stat").read_text().rpartition(")")[2].split()
        except OSError:
            return None
        return None if state in _GONE else int(fields[18])
    words = _ps(pid, "stat=,lstart=").split()
    if not words or words[0][0] in _GONE:
        return None
    return int(time.mktime(time.strptime(" ".join(words[1:]), "%a %b %d %H:%M:%S %Y")))


def expanded(path: Path) -> Path:
    """The path with the home of a user in place of `~` or `~user`; another name that begins with ~ is that name."""
    try:
        return path.expanduser()
    except RuntimeError:  # there is no such user
        return path


def single_threaded(function: Callable[P, T]) -> Callable[P, T]:
    """The function, while which the libraries of linear algebra use one thread each.

    Small matrices gain nothing from more; threads that wait for one another on busy cores cost ten times the work.
    """

    @wraps(function)
    def alone(*args: P.args, **kwargs: P.kwargs) -> T:
        with threadpool_limits(limits=1):
            return function(*args, **kwargs)

    return alone


def age_s(pid: int) -> float | None:
    """Seconds since a process of this machine was started; None if there is none."""
    began = started(pid)
    if began is None:
        return None
    if PROC.is_dir():
        return float((PROC / "uptime").read_text().split()[0]) - began / os.sysconf("SC_CLK_TCK")
    return time.time() - began


def is_alive(pid: int) -> bool:
    """Whether there is such a process, and it has not ended."""
    return started(pid) is not None


def command_line(pid: int) -> bytes:
    """The words that a process was started with; empty if there is none."""
    if PROC.is_dir():
        with contextlib.suppress(OSError):
            return (PROC / str(pid) / "cmdline").read_bytes()
        return b""
    return os.fsencode(_ps(pid, "args="))


def num_threads(pid: int) -> int:
    """Threads of a process; 1 where the system does not report it."""
    try:
        return len(list((PROC / str(pid) / "task").iterdir()))
    except OSError:
        return 1


def resident_mb() -> float:
    """Memory of this process, MB; 0 where the system does not report it."""
    try:
        return int((PROC / "self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    except (OSError, ValueError):
        return float(_ps(os.getpid(), "rss=") or 0) * 1024 / 1e6


def peak_memory_mb() -> float:
    """The most memory that this process has had, in 2^20 bytes: getrusage(2) counts in kB, on macOS in bytes."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1 << 20 if sys.platform == "darwin" else 1 << 10)


def available_bytes() -> int | None:
    """Memory that programs may still take; None where the system does not report it."""
    try:
        facts = dict(line.split(":", 1) for line in (PROC / "meminfo").read_text().splitlines() if ":" in line)
        return int(facts["MemAvailable"].split()[0]) * 1024
    except (OSError, KeyError):
        return None


def _ps(pid: int, fields: str) -> str:
    """What `ps` (POSIX) prints of a process; empty if there is none."""
    command = ["ps", "-ww", "-o", fields, "-p", str(pid)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, "LC_ALL": "C"})
    except OSError:
        return ""
    return done.stdout.strip()
