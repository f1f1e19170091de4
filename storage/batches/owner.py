"""The process that computes a video: on its own machine the kernel says whether it lives, elsewhere its lease does."""

import functools
import os
import socket
from dataclasses import dataclass
from pathlib import Path

LEASE_S = 30.0
"""Seconds after the last renewal until another machine may take over the video of an owner."""
RENEW_S = 10.0


@dataclass(frozen=True)
class Owner:
    """A process, under a name that no other process ever has."""

    machine: str
    """One boot of a kernel and one namespace of process ids."""
    pid: int
    started: int
    """Clock ticks from the boot to its start: a process that gets the same id later has another."""

    @classmethod
    def this_process(cls) -> "Owner":
        """The process that calls."""
        return cls(_machine(), os.getpid(), _started(os.getpid()) or 0)

    @classmethod
    def parse(cls, text: str) -> "Owner":
        """The owner that `str` wrote."""
        machine, pid, started = text.split()
        return cls(machine, int(pid), int(started))

    def __str__(self) -> str:
        return f"{self.machine} {self.pid} {self.started}"

    def is_alive(self) -> bool | None:
        """Whether the process lives; None if it runs on another machine, which this one cannot see."""
        return _started(self.pid) == self.started if self.machine == _machine() else None


def process_age_s(pid: int) -> float | None:
    """Seconds since a process of this machine was started; None if there is none."""
    started = _started(pid)
    uptime_s = float(Path("/proc/uptime").read_text().split()[0])
    return None if started is None else uptime_s - started / os.sysconf("SC_CLK_TCK")


@functools.cache
def _machine() -> str:
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
        return f"{boot}/{Path('/proc/self/ns/pid').stat().st_ino}"
    except OSError:  # a sandbox that hides them
        return socket.gethostname()


def _started(pid: int) -> int | None:
    """Clock ticks from the boot to the start of a living process (proc(5), field 22 of /proc/PID/stat)."""
    try:
        state, *fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return None
    return None if state in "ZX" else int(fields[18])
