"""What has become of every video of every batch, in the store, whatever happens to Prefect's database.

The process that computes a video holds a lock of the store while it does (`BatchLedger.hold`): a row that says
`running` without a holder is a lost run. `humanmm.storage.batches.disk_ledger` keeps the rows in a SQLite file,
`humanmm.storage.batches.bucket_ledger` in objects beside a store in a bucket.
"""

import contextlib
import hashlib
import json
import os
import socket
import time
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from humanmm.errors import InputError
from humanmm.storage.store.store import Store

STATES = ("scheduled", "running", "done", "partial", "failed", "cancelled")
HOLD_LIMIT_S = 2.0
MAX_LOSSES = 2
"""How often a video whose process was lost is tried again without being asked, if it gets no further meanwhile."""
AT_A_TIME = 16
"""Videos whose holders are asked after at the same time: in a bucket each answer takes its time."""


@dataclass(frozen=True)
class VideoRow:
    """One video of a batch."""

    batch: str
    video: str
    position: int
    run_dir: str
    config: str
    """Its whole configuration as json."""
    priority: str
    tags: str
    """Tags as a json list."""
    facts: str
    """Size, modification time and inode of the file as json, empty if there is none: another file is another video."""
    recipe: str
    """Digest of code, weights, libraries and settings: what is finished with another recipe is not finished."""
    attempt: int = 1
    state: str = "scheduled"
    stage: str | None = None
    """Where it is, or where it failed."""
    reason: str = ""
    seconds: float | None = None
    flow_run: str | None = None
    pid: int | None = None
    """Its process, on `host`."""
    changed: float = 0.0
    """When it changed its state, seconds since 1970."""
    losses: int = 0
    """How often its process was lost since it got further."""
    host: str = ""
    """Where it was computed last: its process and its run folder are there."""

    @property
    def lock_key(self) -> str:
        return hashlib.sha256(f"{self.batch}\0{self.video}".encode()).hexdigest()[:32]

    @property
    def is_elsewhere(self) -> bool:
        """Whether another machine than this one has computed it."""
        return self.host not in ("", socket.gethostname())

    def same_work(self, other: "VideoRow") -> bool:
        """True if both ask for the same file to be recovered in the same way into the same folder."""
        return (self.facts, self.recipe, self.run_dir) == (other.facts, other.recipe, other.run_dir)

    def to_json(self) -> dict[str, Any]:
        """The row as `batch status --json` tells it."""
        return {name: getattr(self, name) for name in ("video", "state", "stage", "reason", "run_dir", "seconds")}


class BatchLedger(ABC):
    """The batches of one store."""

    def __init__(self, store: Store) -> None:
        self.store = store

    # ---- batches

    @abstractmethod
    def put(self, name: str, source: str, rows: Sequence[VideoRow]) -> list[VideoRow]:
        """Write new rows of a batch, and new attempts at known ones; returns the rows as they stand then.

        They differ from those given where somebody else has written the same attempt first: that one counts.
        """

    @abstractmethod
    def names(self) -> list[str]:
        """All batches, newest first."""

    def newest(self) -> str:
        """Name of the newest batch; InputError if there is none."""
        names = self.names()
        if not names:
            raise InputError(f"the store {self.store.location} knows no batch; `humanmm batch submit` makes one")
        return names[0]

    def check(self, name: str) -> str:
        """The name, if there is such a batch."""
        known = self.names()
        if name not in known:
            listed = ", ".join(known[:5]) or "none"
            raise InputError(f"the store {self.store.location} knows no batch {name!r}; known: {listed}")
        return name

    @abstractmethod
    def rows(self, batch: str, *states: str) -> list[VideoRow]:
        """The videos of a batch in order, of all states or of some."""

    @abstractmethod
    def row(self, batch: str, video: str) -> VideoRow | None:
        """One video of a batch."""

    @abstractmethod
    def finished(self) -> dict[tuple[str, str, str], tuple[str, str]]:
        """Video, facts and recipe → run folder and its host of everything that any batch has finished."""

    @abstractmethod
    def unscheduled(self, limit: int = 200) -> list[VideoRow]:
        """Videos that wait although nobody was told to run them, of all batches."""

    @abstractmethod
    def last_changes(self) -> dict[str, float]:
        """Batch → when one of its videos changed its state last."""

    @abstractmethod
    def batches_at_work(self) -> list[str]:
        """Batches of which some video runs."""

    # ---- one video

    @abstractmethod
    def change(self, row: VideoRow, *, only_from: Iterable[str] = STATES, **values: Any) -> bool:
        """Change a row if it still has the same attempt and one of these states; says whether it had."""

    @contextlib.contextmanager
    def hold(self, row: VideoRow) -> Iterator[bool]:
        """Be the one process that computes this video; False if another one is."""
        deadline = time.monotonic() + HOLD_LIMIT_S
        while True:
            with self.store.try_lock("video", row.lock_key) as held:
                if held or time.monotonic() > deadline:
                    yield held
                    return
            time.sleep(0.05)  # somebody may have been asking whether it is held

    def is_held(self, row: VideoRow) -> bool:
        """Whether some process computes this video now."""
        return self.store.is_locked("video", row.lock_key)

    def find_lost(self, batch: str) -> list[VideoRow]:
        """Find the running videos whose process has died, and tell which they are.

        They wait for another attempt, which whoever runs flows schedules; too often lost, they are failed.
        """
        lost = []
        running = self.rows(batch, "running")
        with ThreadPoolExecutor(AT_A_TIME) as threads:
            held = list(threads.map(self.is_held, running))
        for row, is_held in zip(running, held, strict=True):
            if not is_held and (found := self.row(row.batch, row.video)) is not None:
                place = f" during {found.stage}" if found.stage else ""
                reason = f"its process was lost{place}: it was killed, ran out of memory, or the machine went down"
                if self.lose(found, reason):
                    lost.append(found)
        return lost

    def never_began(self, row: VideoRow, reason: str) -> bool:
        """Note that the flow run of a waiting video ended before its process began; it counts as lost."""
        return self.lose(row, reason, only_from="scheduled")

    def lose(self, row: VideoRow, reason: str, *, only_from: str = "running", **more: Any) -> bool:
        """Note that an attempt came to nothing through no fault of the video: it gets another one, but not for ever."""
        values: dict[str, Any] = {"losses": row.losses + 1, "reason": reason, "state": "failed", **more}
        if row.losses < MAX_LOSSES:
            values |= _another_attempt(row)
        return self.change(row, only_from=(only_from,), **values)

    def try_again(self, row: VideoRow, reason: str) -> bool:
        """Have a running video wait for another attempt; says whether it was running still."""
        return self.change(row, only_from=("running",), reason=reason, **_another_attempt(row))


def _another_attempt(row: VideoRow) -> dict[str, Any]:
    return {"state": "scheduled", "attempt": row.attempt + 1, "flow_run": None, "pid": None}


def facts_of(video: Path) -> str:
    """Size, modification time and inode of a file as json; empty if it cannot be seen."""
    try:
        status = video.stat()
    except OSError:
        return ""
    return json.dumps([status.st_size, status.st_mtime_ns, status.st_ino])


def counts(rows: Iterable[VideoRow]) -> Mapping[str, int]:
    """State → number of videos, states without any left out."""
    states = [row.state for row in rows]
    return {state: states.count(state) for state in STATES if state in states}


def has_run_record(run_dir: str) -> bool:
    """True if a run folder is still there."""
    return os.path.exists(f"{run_dir}/run.json")  # noqa: PTH110  (10,000 of them are asked for)
