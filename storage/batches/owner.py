"""The process that computes a video: on its own machine the kernel says whether it lives, elsewhere its lease does."""

import os
from dataclasses import dataclass

from humanmm.machine import machine_name, started

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
        return cls(machine_name(), os.getpid(), started(os.getpid()) or 0)

    @classmethod
    def parse(cls, text: str) -> "Owner":
        """The owner that `str` wrote."""
        machine, pid, started = text.split()
        return cls(machine, int(pid), int(started))

    def __str__(self) -> str:
        return f"{self.machine} {self.pid} {self.started}"

    def is_alive(self) -> bool | None:
        """Whether the process lives; None if it runs on another machine, which this one cannot see."""
        return started(self.pid) == self.started if self.machine == machine_name() else None
