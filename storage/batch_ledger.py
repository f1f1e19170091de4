"""What has become of every video of every batch: one SQLite file in the store, whatever happens to Prefect's database.

A row a video. The process that computes a video holds a flock while it does (`BatchLedger.hold`), which the kernel
frees when it dies: a row that says `running` without a holder is a lost run.
"""

import contextlib
import hashlib
import json
import os
import sqlite3
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from humanmm.errors import InputError, StoreError
from humanmm.storage.store import Store

STATES = ("scheduled", "running", "done", "partial", "failed", "cancelled")
FILE = "batches.sqlite"
HOLD_LIMIT_S = 2.0
MAX_LOSSES = 2
"""How often a video whose process was lost is tried again without being asked, if it gets no further meanwhile."""

_SCHEMA = """
create table if not exists batch (name text primary key, source text, created real);
create table if not exists video (
    batch text, video text, position integer, run_dir text, config text, priority text, tags text,
    facts text, recipe text, attempt integer, state text, stage text, reason text, seconds real,
    flow_run text, pid integer, changed real, losses integer default 0,
    primary key (batch, video)
);
create index if not exists video_state on video (batch, state);
create index if not exists video_path on video (video);
"""


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
    changed: float = 0.0
    """When it changed its state, seconds since 1970."""
    losses: int = 0
    """How often its process was lost since it got further."""

    @property
    def lock_key(self) -> str:
        return hashlib.sha256(f"{self.batch}\0{self.video}".encode()).hexdigest()[:32]

    def same_work(self, other: "VideoRow") -> bool:
        """True if both ask for the same file to be recovered in the same way into the same folder."""
        return (self.facts, self.recipe, self.run_dir) == (other.facts, other.recipe, other.run_dir)

    def to_json(self) -> dict[str, Any]:
        """The row as `batch status --json` tells it."""
        return {name: getattr(self, name) for name in ("video", "state", "stage", "reason", "run_dir", "seconds")}


_NAMES = [field.name for field in fields(VideoRow)]


class BatchLedger:
    """The batches of one store."""

    def __init__(self, store: Store) -> None:
        self.store = store
        self.path = store.root / FILE

    # ---- batches

    def put(self, name: str, source: str, rows: Sequence[VideoRow]) -> None:
        """Write rows of a batch, new ones and changed ones, all or none."""
        now = time.time()
        values = [[getattr(replace(row, changed=now), field) for field in _NAMES] for row in rows]
        with self._transaction() as connection:
            connection.execute("insert or ignore into batch values (?, ?, ?)", (name, source, now))
            marks = ", ".join("?" * len(_NAMES))
            connection.executemany(f"insert or replace into video ({', '.join(_NAMES)}) values ({marks})", values)

    def newest(self) -> str:
        """Name of the newest batch; InputError if there is none."""
        found = self._select("select name from batch order by created desc limit 1")
        if not found:
            raise InputError(f"the store {self.store.root} knows no batch; `humanmm batch submit` makes one")
        return str(found[0][0])

    def names(self) -> list[str]:
        """All batches, newest first."""
        return [str(name) for (name,) in self._select("select name from batch order by created desc")]

    def check(self, name: str) -> str:
        """The name, if there is such a batch."""
        known = self.names()
        if name not in known:
            listed = ", ".join(known[:5]) or "none"
            raise InputError(f"the store {self.store.root} knows no batch {name!r}; known: {listed}")
        return name

    def rows(self, batch: str, *states: str) -> list[VideoRow]:
        """The videos of a batch in order, of all states or of some."""
        condition = f" and state in ({', '.join('?' * len(states))})" if states else ""
        query = f"select {', '.join(_NAMES)} from video where batch = ?{condition} order by position"
        return [VideoRow(*values) for values in self._select(query, batch, *states)]

    def row(self, batch: str, video: str) -> VideoRow | None:
        """One video of a batch."""
        query = f"select {', '.join(_NAMES)} from video where batch = ? and video = ?"
        return next((VideoRow(*values) for values in self._select(query, batch, video)), None)

    def finished(self) -> dict[tuple[str, str, str], str]:
        """Video, facts and recipe → run folder of everything that any batch has finished."""
        found = self._select("select video, facts, recipe, run_dir from video where state = 'done'")
        return {(video, facts, recipe): run_dir for video, facts, recipe, run_dir in found}

    # ---- one video

    def change(self, row: VideoRow, *, only_from: Iterable[str] = STATES, **values: Any) -> bool:
        """Change a row if it still has the same attempt and one of these states; says whether it had."""
        states = tuple(only_from)
        if "state" in values:
            values["changed"] = time.time()
        assignments = ", ".join(f"{name} = ?" for name in values)
        condition = f"batch = ? and video = ? and attempt = ? and state in ({', '.join('?' * len(states))})"
        with self._transaction() as connection:
            done = connection.execute(
                f"update video set {assignments} where {condition}",
                (*values.values(), row.batch, row.video, row.attempt, *states),
            )
            return done.rowcount == 1

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
        with self.store.try_lock("video", row.lock_key) as free:
            return not free

    def find_lost(self, batch: str) -> list[VideoRow]:
        """Find the running videos whose process has died, and tell which they are.

        They wait for another attempt, which whoever runs flows schedules; too often lost, they are failed.
        """
        lost = []
        for row in self.rows(batch, "running"):
            if not self.is_held(row) and (found := self.row(row.batch, row.video)) is not None:
                place = f" during {found.stage}" if found.stage else ""
                reason = f"its process was lost{place}: it was killed, ran out of memory, or the machine went down"
                values = {"losses": found.losses + 1, "reason": reason, "state": "failed"}
                if found.losses < MAX_LOSSES:
                    values |= _another_attempt(found)
                if self.change(found, only_from=("running",), **values):
                    lost.append(found)
        return lost

    def never_began(self, row: VideoRow, reason: str) -> bool:
        """Note that the flow run of a waiting video ended before its process began; it counts as lost."""
        values: dict[str, Any] = {"losses": row.losses + 1, "reason": reason, "state": "failed"}
        if row.losses < MAX_LOSSES:
            values |= _another_attempt(row)
        return self.change(row, only_from=("scheduled",), **values)

    def try_again(self, row: VideoRow, reason: str) -> bool:
        """Have a running video wait for another attempt; says whether it was running still."""
        return self.change(row, only_from=("running",), reason=reason, **_another_attempt(row))

    def unscheduled(self, limit: int = 200) -> list[VideoRow]:
        """Videos that wait although nobody was told to run them, of all batches."""
        query = f"select {', '.join(_NAMES)} from video where state = 'scheduled' and flow_run is null limit ?"
        return [VideoRow(*values) for values in self._select(query, limit)]

    def last_changes(self) -> dict[str, float]:
        """Batch → when one of its videos changed its state last."""
        return {
            str(name): float(at) for name, at in self._select("select batch, max(changed) from video group by batch")
        }

    def batches_at_work(self) -> list[str]:
        """Batches of which some video runs."""
        return [str(name) for (name,) in self._select("select distinct batch from video where state = 'running'")]

    # ---- the file

    @contextlib.contextmanager
    def _transaction(self) -> Iterator[sqlite3.Connection]:
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with contextlib.closing(sqlite3.connect(self.path, timeout=60)) as connection, connection:
                connection.executescript(_SCHEMA)
                _bring_up_to_date(connection)
                connection.execute("begin immediate")
                yield connection
        except (sqlite3.Error, OSError) as error:
            raise StoreError(f"cannot write the batches of the store, {self.path}: {error}") from error

    def _select(self, query: str, *values: object) -> list[tuple[Any, ...]]:
        if not self.path.exists():
            return []
        try:
            with contextlib.closing(sqlite3.connect(self.path, timeout=60)) as connection:
                _bring_up_to_date(connection)
                return connection.execute(query, values).fetchall()
        except sqlite3.Error as error:
            raise StoreError(f"cannot read the batches of the store, {self.path}: {error}") from error


def _another_attempt(row: VideoRow) -> dict[str, Any]:
    return {"state": "scheduled", "attempt": row.attempt + 1, "flow_run": None, "pid": None}


def _bring_up_to_date(connection: sqlite3.Connection) -> None:
    """Add what a ledger of an earlier version lacks."""
    columns = {name for _, name, *_ in connection.execute("pragma table_info(video)")}
    if columns and "losses" not in columns:
        connection.execute("alter table video add column losses integer default 0")


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
