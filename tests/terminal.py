"""A command on a pseudo-terminal: what it writes and when, and keys that are pressed meanwhile."""

import fcntl
import os
import pty
import re
import select
import signal
import struct
import termios
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

CTRL_C = b"\x03"
_CONTROL = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]|\r")


@dataclass(frozen=True)
class Session:
    """What came of a command. Times are seconds since it was started."""

    status: int
    pieces: tuple[tuple[float, str], ...]
    """When something was written, and what."""
    pressed: float | None
    """When the key was pressed, if it was."""
    ended: float

    @property
    def text(self) -> str:
        """Everything that was written, without what moves the cursor."""
        return _CONTROL.sub("", "".join(piece for _, piece in self.pieces))

    @property
    def last_lines(self) -> list[str]:
        """What stands below the display when it has been taken away."""
        written = "".join(piece for _, piece in self.pieces)
        after = written[max(written.rfind("\x1b[?25h"), 0) :]  # the cursor is shown again
        return [line for line in _CONTROL.sub("", after).splitlines() if line.strip()]

    @property
    def longest_silence_s(self) -> float:
        """Between two pieces, from the first one to the last one."""
        moments = [moment for moment, _ in self.pieces]
        return max((after - before for before, after in pairwise(moments)), default=self.ended)


def on_terminal(
    command: Sequence[str],
    *,
    cwd: Path,
    env: Mapping[str, str],
    press_when: Callable[[str], bool] = lambda text: False,
    times: int = 1,
    limit_s: float = 200.0,
) -> Session:
    """Run a command on a terminal of 100 x 40; press Ctrl-C so many times when `press_when(what was written)`."""
    pid, terminal = pty.fork()
    if pid == 0:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        os.chdir(cwd)
        os.execvpe(command[0], list(command), {**env, "TERM": "xterm-256color"})
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 100, 0, 0))
    begun, pieces, pressed = time.monotonic(), [], None
    while time.monotonic() - begun < limit_s:
        if pressed is None and press_when("".join(piece for _, piece in pieces)):
            pressed = time.monotonic() - begun
            os.write(terminal, CTRL_C * times)
        if select.select([terminal], [], [], 0.05)[0]:
            try:
                data = os.read(terminal, 65536)
            except OSError:  # the command has ended
                break
            if not data:
                break
            pieces.append((time.monotonic() - begun, data.decode(errors="replace")))
    else:
        os.kill(pid, signal.SIGKILL)
    _, status = os.waitpid(pid, 0)
    return Session(os.waitstatus_to_exitcode(status), tuple(pieces), pressed, time.monotonic() - begun)
