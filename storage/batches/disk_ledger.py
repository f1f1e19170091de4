"""The ledger of batches of a store on a local disk: one SQLite file, a row a video."""

import contextlib
import sqlite3
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import fields, replace
from typing import Any

from humanmm.errors import StoreError
from humanmm.storage.batches.batch_ledger import STATES, BatchLedger, VideoRow
from humanmm.storage.store.store import Store

FILE = "batches.sqlite"

_SCHEMA = """
create table if not exists batch (name text primary key, source text, created real);
create table if not exists video (
    batch text, video text, position integer, run_dir text, config text, priority text, tags text,
    facts text, recipe text, attempt integer, state text, stage text, reason text, seconds real,
    flow_run text, pid integer, changed real, losses integer default 0, host text default '',
    primary key (batch, video)
);
create index if not exists video_state on video (batch, state);
create index if not exists video_path on video (video);
"""
_LATER = {"losses": "integer default 0", "host": "text default ''"}
"""Columns that a ledger of an earlier version lacks."""

_NAMES = [field.name for field in fields(VideoRow)]
_COLUMNS = ", ".join(_NAMES)


class DiskLedger(BatchLedger):
    """The batches of one store on a local disk."""

    def __init__(self, store: Store) -> None:
        super().__init__(store)
        self.path = store.root / FILE

    # ---- batches

    def put(self, name: str, source: str, rows: Sequence[VideoRow]) -> list[VideoRow]:
        """All of them or none, see `BatchLedger.put`."""
        now = time.time()
        values = [[getattr(replace(row, changed=now), field) for field in _NAMES] for row in rows]
        fresh = ", ".join(f"{column} = excluded.{column}" for column in _NAMES)
        with self._transaction() as connection:
            connection.execute("insert or ignore into batch values (?, ?, ?)", (name, source, now))
            connection.executemany(
                f"insert into video ({_COLUMNS}) values ({', '.join('?' * len(_NAMES))}) "
                f"on conflict do update set {fresh} where excluded.attempt > attempt",
                values,
            )
        standing = {row.video: row for row in self.rows(name)}
        return [standing[row.video] for row in rows]

    def names(self) -> list[str]:
        return [str(name) for (name,) in self._select("select name from batch order by created desc")]

    def rows(self, batch: str, *states: str) -> list[VideoRow]:
        condition = f" and state in ({', '.join('?' * len(states))})" if states else ""
        query = f"select {_COLUMNS} from video where batch = ?{condition} order by position"
        return [VideoRow(*values) for values in self._select(query, batch, *states)]

    def row(self, batch: str, video: str) -> VideoRow | None:
        query = f"select {_COLUMNS} from video where batch = ? and video = ?"
        return next((VideoRow(*values) for values in self._select(query, batch, video)), None)

    def finished(self) -> dict[tuple[str, str, str], tuple[str, str]]:
        found = self._select("select video, facts, recipe, run_dir, host from video where state = 'done'")
        return {(video, facts, recipe): (run_dir, host) for video, facts, recipe, run_dir, host in found}

    def unscheduled(self, limit: int = 200) -> list[VideoRow]:
        query = f"select {_COLUMNS} from video where state = 'scheduled' and flow_run is null limit ?"
        return [VideoRow(*values) for values in self._select(query, limit)]

    def last_changes(self) -> dict[str, float]:
        return {
            str(name): float(at) for name, at in self._select("select batch, max(changed) from video group by batch")
        }

    def batches_at_work(self) -> list[str]:
        return [str(name) for (name,) in self._select("select distinct batch from video where state = 'running'")]

    # ---- one video

    def change(self, row: VideoRow, *, only_from: Iterable[str] = STATES, **values: Any) -> bool:
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


def _bring_up_to_date(connection: sqlite3.Connection) -> None:
    """Add what a ledger of an earlier version lacks."""
    columns = {name for _, name, *_ in connection.execute("pragma table_info(video)")}
    for name, kind in _LATER.items():
        if columns and name not in columns:
            connection.execute(f"alter table video add column {name} {kind}")
