"""Files that somebody may still be writing: which have stopped growing."""

import time
from collections.abc import Sequence
from pathlib import Path

from humanmm.storage.batches.manifest import Entry
from humanmm.storage.batches.video_row import facts_of


def is_quiet(path: Path, settle_s: float) -> bool:
    """True if a file was not written to for so many seconds, or is dated so far in the future, as by a camera with a
    wrong clock; the run of one that cannot be read says so."""
    try:
        return abs(time.time() - path.stat().st_mtime) >= settle_s
    except OSError:
        return True


class Settled:
    """A watched folder: a file is taken when its size and time stayed the same for `settle_s` seconds of looking.

    The file's own time is not trusted: copying programs set it to that of the original, also before they are done.
    """

    def __init__(self, settle_s: float) -> None:
        self._settle_s = settle_s
        self._seen: dict[Path, tuple[str, float]] = {}

    def look(self, entries: Sequence[Entry], now: float) -> dict[Path, str]:
        """The settled files among what the folder holds at `now` (seconds of any clock), with their facts."""
        seen = {}
        for entry in entries:
            facts = facts_of(entry.video)
            before = self._seen.get(entry.video)
            seen[entry.video] = before if before is not None and before[0] == facts else (facts, now)
        self._seen = seen
        return {path: facts for path, (facts, since) in seen.items() if now - since >= self._settle_s}
