"""Loaded by Python at its start where this folder is on its path: this process then lacks what only Linux has.

`sys.platform` is that of macOS, /proc and /sys are not there, nor are the functions of `os`, `socket` and `signal` that
Python has on Linux alone, nor prctl and glibc's functions. What was compiled for Linux stays, and so does
`platform.system()`, by which torch names its libraries.
"""

import ctypes
import os
import signal
import socket
import sys
import sysconfig
import types
from typing import Any

_HIDDEN = ("/proc", "/sys/", "/dev/shm")

for _module, _names in {
    os: (
        "sched_getaffinity", "sched_setaffinity", "pidfd_open", "memfd_create", "eventfd", "posix_fadvise", "fallocate",
        "posix_fallocate", "copy_file_range", "splice", "pipe2", "getrandom", "fdatasync", "getxattr", "setns",
        "O_TMPFILE", "O_PATH", "O_DIRECT",
    ),
    socket: ("AF_NETLINK", "SOCK_CLOEXEC", "SO_PEERCRED", "MSG_NOSIGNAL"),
    signal: ("sigtimedwait", "sigwaitinfo", "pidfd_send_signal", "SIGRTMIN", "SIGRTMAX"),
}.items():  # fmt: skip
    for _name in _names:
        if hasattr(_module, _name):
            delattr(_module, _name)


def _hide(name: str) -> None:
    shown = getattr(os, name)

    def function(path: Any = ".", *args: Any, **kwargs: Any) -> Any:
        if isinstance(path, str | os.PathLike) and str(path).startswith(_HIDDEN):
            raise FileNotFoundError(2, "No such file or directory", str(path))
        return shown(path, *args, **kwargs)

    setattr(os, name, function)


for _name in ("stat", "lstat", "scandir", "listdir", "open", "readlink"):
    _hide(_name)


def _refuse(event: str, args: tuple[Any, ...]) -> None:
    if event == "open" and isinstance(args[0], str) and args[0].startswith(_HIDDEN):
        raise FileNotFoundError(2, "No such file or directory", args[0])


sys.addaudithook(_refuse)

_load = ctypes.CDLL


class _Library(_load):
    """A library of C without what macOS's lacks."""

    def __getattr__(self, name: str) -> Any:
        if name in ("prctl", "mallopt", "malloc_trim"):
            raise AttributeError(name)
        return super().__getattr__(name)


ctypes.CDLL = _Library  # type: ignore[misc]
_settings: Any = types.ModuleType("_scproxy")  # macOS's, which `urllib` reads proxies from
_settings._get_proxy_settings = lambda: {"exclude_simple": True}
_settings._get_proxies = dict
sys.modules["_scproxy"] = _settings
sysconfig.get_config_vars()  # of this Python, read by the name of its system
sys.platform = "darwin"
