"""The batch table: what has become of every video of every batch, whatever happens to Prefect's database.

It is one table of a SQLite file beside the store (for a store in a bucket, below the user's data folder), or of the
team's Postgres that `$HUMANMM_DATABASE_URL` names. The process that computes a video owns its row and renews its lease
(`humanmm.storage.batches.owner`): a row that says `running` without a living owner is a lost run.

SQLite keeps its rollback journal: hosts that share the file over a network file system could not use it at the same
time with a write-ahead log (https://sqlite.org/wal.html).
"""

import contextlib
import functools
import hashlib
import importlib
import os
import re
import socket
import sqlite3
import threading
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import sqlalchemy as sa
from sqlalchemy.schema import CreateIndex, CreateTable

from humanmm.errors import ConfigError, InputError, StoreError
from humanmm.storage.batches.owner import Owner
from humanmm.storage.batches.video_row import STATES, VideoRow
from humanmm.storage.store.bucket import is_bucket
from humanmm.storage.store.files import explain_os_error, store_errors, try_to_write
from humanmm.storage.store.open import open_store
from humanmm.storage.store.store import Store

FILE = "batches.sqlite"
DATABASE_URL = "HUMANMM_DATABASE_URL"
"""Environment variable: the database of hosts that share a store, as `postgresql://user:password@host/name`."""
MAX_LOSSES = 2
"""How often a video whose process was lost is scheduled again by itself, if it makes no progress meanwhile."""
TIMEOUT_S = 60.0
"""How long a change waits for those of other processes."""
UNSCHEDULED_LIMIT = 200
CLAIM_LIMIT_S = 2.0
"""How long a claim waits for an owner that is about to release the video."""

VIDEOS = sa.Table(
    "humanmm_videos",
    sa.MetaData(),
    sa.Column("store", sa.Text, primary_key=True),  # empty in a file that belongs to one store, which may be moved
    sa.Column("batch", sa.Text, primary_key=True),
    sa.Column("video", sa.Text, primary_key=True),
    sa.Column("position", sa.Integer),
    *(sa.Column(name, sa.Text) for name in ("run_dir", "config", "priority", "tags", "facts", "recipe")),
    sa.Column("attempt", sa.Integer),
    *(sa.Column(name, sa.Text) for name in ("state", "stage", "reason")),
    sa.Column("seconds", sa.Double),
    sa.Column("flow_run", sa.Text),
    sa.Column("changed", sa.Double),
    sa.Column("losses", sa.Integer),
    *(sa.Column(name, sa.Text) for name in ("host", "owner")),
    sa.Column("renewed", sa.Double),  # the owner's lease, seconds since 1970 by the clock of the database
    sa.Column("created", sa.Double),
    sa.Column("hopeless", sa.Boolean, server_default=sa.false()),
)
_ADD_HOPELESS = f"alter table {VIDEOS.name} add column hopeless boolean default false"
"""For a table of an earlier version."""
_LATER = VIDEOS.alias("later")
_OTHER_RESULT = (
    _LATER.c.store == VIDEOS.c.store,
    _LATER.c.run_dir == VIDEOS.c.run_dir,
    _LATER.c.batch != VIDEOS.c.batch,
    sa.or_(*(_LATER.c[name] != VIDEOS.c[name] for name in ("video", "facts", "recipe"))),
)
"""Two rows of different batches, of which each wants a result of its own in the same run folder."""
_OPENING = threading.Lock()
_BY_STATE = sa.Index("humanmm_videos_by_state", VIDEOS.c.store, VIDEOS.c.state, VIDEOS.c.batch)
_BY_RUN_DIR = sa.Index("humanmm_videos_by_run_dir", VIDEOS.c.store, VIDEOS.c.run_dir)
_FIELDS = {field.name: field.default for field in fields(VideoRow) if field.name != "unrenewed_s"}
_REPLACED = [name for name in _FIELDS if name not in ("batch", "video", "owner")]
"""What another attempt changes: whoever owns the video still has to release it."""


def open_batches(location: Path | str | None = None, *, read_only: bool = False) -> "BatchTable":
    """Open the batches of the store in a folder or in a bucket, else of the user's own store."""
    return BatchTable(open_store(location, read_only=read_only))


class BatchTable:
    """The batches of one store."""

    def __init__(self, store: Store) -> None:
        self.store = store
        given = os.environ.get(DATABASE_URL)
        self.path = None if given else _file_of(store)
        """The SQLite file; None if a database was named."""
        self._url = _shared_url(given) if given else sa.URL.create("sqlite", database=str(self.path))
        self._store = store.location if given else ""

    @property
    def exists(self) -> bool:
        """Whether there may be batches in it."""
        return self.path is None or self.path.exists()

    @property
    def is_of_this_host(self) -> bool:
        """Whether other hosts that share the store do not see it."""
        return self.path is not None and is_bucket(self.store.location)

    @property
    def where(self) -> str:
        """The file, or the database without its password."""
        return str(self.path or self._url.render_as_string(hide_password=True))

    # ---- batches

    def put(self, rows: Sequence[VideoRow]) -> list[VideoRow]:
        """Write new rows of a batch, and new attempts at known ones, all or none; returns the rows as they stand then.

        They differ from those given where somebody else has written the same attempt first: that one counts.
        """
        if not rows:
            return []
        now = time.time()
        more = {"store": self._store, "changed": now, "created": now, "renewed": 0.0, "owner": ""}
        values = [{name: getattr(row, name) for name in _FIELDS} | more for row in rows]
        insert: Any = importlib.import_module(f"sqlalchemy.dialects.{self._url.get_backend_name()}").insert(VIDEOS)
        upsert = insert.on_conflict_do_update(
            index_elements=list(VIDEOS.primary_key),
            set_={name: insert.excluded[name] for name in _REPLACED},
            where=insert.excluded.attempt > VIDEOS.c.attempt,
        )
        with self._transaction("write") as connection:
            # with `returning` SQLAlchemy sends a thousand rows a statement: five times as fast in Postgres
            connection.execute(upsert.returning(VIDEOS.c.video), values)
        standing = {row.video: row for row in self.rows(rows[0].batch)}
        return [standing[row.video] for row in rows]

    def names(self) -> list[str]:
        """All batches, newest first."""
        created = sa.func.min(VIDEOS.c.created)
        query = sa.select(VIDEOS.c.batch).where(self._of_store).group_by(VIDEOS.c.batch).order_by(created.desc())
        return [str(name) for (name,) in self._select(query)]

    def newest(self) -> str:
        """Name of the newest batch; InputError if there is none."""
        names = self.names()
        if not names:
            raise InputError(f"the store {self.store.location} has no batch; `humanmm batch submit` makes one")
        return names[0]

    def check(self, name: str) -> str:
        """The name, if there is such a batch."""
        names = self.names()
        if name not in names:
            listed = ", ".join(names[:5]) or "none"
            raise InputError(f"the store {self.store.location} has no batch {name!r}; its batches: {listed}")
        return name

    def rows(self, batch: str, *states: str) -> list[VideoRow]:
        """The videos of a batch in order, of all states or of some."""
        in_states = VIDEOS.c.state.in_(states) if states else sa.true()
        return self._rows(VIDEOS.c.batch == batch, in_states, limit=None)

    def row(self, batch: str, video: str) -> VideoRow | None:
        """One video of a batch."""
        found = self._rows(VIDEOS.c.batch == batch, VIDEOS.c.video == video, limit=1)
        return found[0] if found else None

    def finished(self, rewritten: Mapping[tuple[str, str], str]) -> dict[tuple[str, str, str], tuple[str, str, float]]:
        """Video, facts and recipe → run folder, its host, and when it ended, of everything that any batch has finished,
        but for what was `rewritten`."""
        c = VIDEOS.c
        columns = (c.batch, c.video, c.facts, c.recipe, c.run_dir, c.host, c.changed)
        found = self._select(sa.select(*columns).where(self._of_store, c.state == "done"))
        kept = (values for batch, *values in found if (batch, values[0]) not in rewritten)
        return {(video, facts, recipe): (run_dir, host, ended) for video, facts, recipe, run_dir, host, ended in kept}

    def rewritten(self) -> dict[tuple[str, str], str]:
        """Batch and video of what is done → the batch that has written another result to its run folder since."""
        mine, later = VIDEOS.c, _LATER.c
        written = (mine.state == "done", later.state.in_(("done", "partial")), later.changed > mine.changed)
        query = sa.select(mine.batch, mine.video, later.batch).where(self._of_store, *_OTHER_RESULT, *written)
        found = self._select(query.order_by(later.changed))
        return {(batch, video): by for batch, video, by in found}

    def displaced(self, batch: str) -> dict[str, str]:
        """Videos of a batch → the other batch whose finished result, a different one, has the same run folder."""
        mine, other = VIDEOS.c, _LATER.c
        ours = (self._of_store, mine.batch == batch, other.state == "done")
        found = self._select(sa.select(mine.video, other.batch).where(*ours, *_OTHER_RESULT).order_by(other.changed))
        return {video: other_batch for video, other_batch in found}

    def unscheduled(self) -> list[VideoRow]:
        """Videos that wait without a flow run, of all batches; UNSCHEDULED_LIMIT of them at a time."""
        return self._rows(VIDEOS.c.state == "scheduled", VIDEOS.c.flow_run.is_(None), limit=UNSCHEDULED_LIMIT)

    def last_changes(self) -> dict[str, float]:
        """Batch → when one of its videos changed its state last."""
        last = sa.func.max(VIDEOS.c.changed)
        found = self._select(sa.select(VIDEOS.c.batch, last).where(self._of_store).group_by(VIDEOS.c.batch))
        return {str(name): float(at) for name, at in found}

    def running_batches(self) -> list[str]:
        """Batches of which some video runs."""
        query = sa.select(VIDEOS.c.batch).where(self._of_store, VIDEOS.c.state == "running").distinct()
        return [str(name) for (name,) in self._select(query)]

    # ---- one video

    def change(
        self, row: VideoRow, *, only_from: Iterable[str] = STATES, if_owner: str | None = None, **values: Any
    ) -> bool:
        """Change a row if it still has the same attempt, one of these states and that owner; returns whether it has."""
        if "state" in values:
            values["changed"] = time.time()
        same = [VIDEOS.c.attempt == row.attempt, VIDEOS.c.state.in_(tuple(only_from))]
        same += [] if if_owner is None else [VIDEOS.c.owner == if_owner]
        return self._update(row, *same, **values)

    def claim(self, row: VideoRow, **values: Any) -> bool:
        """Have this process own a video and call it running; False if another one owns it, or it was cancelled.

        Of processes that claim it at once one succeeds: the owner that each has seen must still be the row's.
        """
        deadline = time.monotonic() + CLAIM_LIMIT_S
        while (found := self.row(row.batch, row.video)) is not None and found.is_owned:
            if time.monotonic() > deadline:
                return False
            time.sleep(0.05)
        mine = {"owner": str(Owner.this_process()), "renewed": self._now(), "host": socket.gethostname()}
        claimable = set(STATES) - {"cancelled"}  # the dashboard's own Retry runs a failed attempt again
        return found is not None and self.change(
            row, only_from=claimable, if_owner=found.owner, state="running", reason="", hopeless=False, **mine, **values
        )

    def renew(self, row: VideoRow) -> bool:
        """Renew this process's lease; False if the video is cancelled, or somebody else's by now."""
        mine = VIDEOS.c.owner == str(Owner.this_process())
        wanted = sa.and_(VIDEOS.c.attempt == row.attempt, VIDEOS.c.state != "cancelled")
        return self._update(row, mine, wanted, renewed=self._now())

    def release(self, row: VideoRow, **values: Any) -> bool:
        """Own a video no longer."""
        return self._update(row, VIDEOS.c.owner == str(Owner.this_process()), owner="", **values)

    def find_lost(self, batch: str) -> list[VideoRow]:
        """The running videos without a living owner.

        They are scheduled for another attempt; if they were lost too often, they have failed.
        """
        lost = []
        for row in self.rows(batch, "running"):
            during = f" during {row.stage}" if row.stage else ""
            reason = f"its process was lost{during}: it was killed, ran out of memory, or the machine went down"
            if not row.is_owned and self.lose(row, reason, if_owner=row.owner):
                lost.append(row)
        return lost

    def lose(self, row: VideoRow, reason: str, *, only_from: str = "running", **more: Any) -> bool:
        """Record that an attempt ended through no fault of the video: it gets another one, but not for ever."""
        values: dict[str, Any] = {"losses": row.losses + 1, "reason": reason, "state": "failed", **more}
        if row.losses < MAX_LOSSES:
            values |= _another_attempt(row)
        return self.change(row, only_from=(only_from,), **values)

    def try_again(self, row: VideoRow, reason: str) -> bool:
        """Have a running video wait for another attempt; returns whether it was still running."""
        return self.change(row, only_from=("running",), reason=reason, **_another_attempt(row))

    # ---- the database

    @property
    def _of_store(self) -> sa.ColumnElement[bool]:
        return VIDEOS.c.store == self._store

    def _now(self) -> sa.ColumnElement[float]:
        """Seconds since 1970: the clocks of hosts that share a database may differ."""
        if self._url.get_backend_name() == "sqlite":
            return sa.literal(time.time())
        return sa.cast(sa.extract("epoch", sa.func.clock_timestamp()), sa.Double)

    def _rows(self, *conditions: sa.ColumnElement[bool], limit: int | None) -> list[VideoRow]:
        columns = [*(VIDEOS.c[name] for name in _FIELDS), self._now() - VIDEOS.c.renewed]
        query = sa.select(*columns).where(self._of_store, *conditions).order_by(VIDEOS.c.position, VIDEOS.c.video)
        return [VideoRow(*values) for values in self._select(query.limit(limit))]

    def _select(self, query: sa.Select[Any]) -> Sequence[Sequence[Any]]:
        if not self.exists:
            return []
        with self._transaction("read") as connection:
            return connection.execute(query).fetchall()

    def _update(self, row: VideoRow, *conditions: sa.ColumnElement[bool], **values: Any) -> bool:
        of_row = sa.and_(self._of_store, VIDEOS.c.batch == row.batch, VIDEOS.c.video == row.video)
        with self._transaction("write") as connection:
            return connection.execute(sa.update(VIDEOS).where(of_row, *conditions).values(**values)).rowcount == 1

    @contextlib.contextmanager
    def _transaction(self, purpose: str) -> Iterator[sa.Connection]:
        what = f"cannot {purpose} the batches of the store, {self.where}"
        try:
            if self.path is not None:
                self.path.parent.mkdir(parents=True, exist_ok=True)
            with _engine(self._url).begin() as connection:
                yield connection
        except OSError as error:
            raise StoreError(explain_os_error(error, what)) from error
        except (sa.exc.SQLAlchemyError, sqlite3.Error) as error:
            if purpose == "write" and self.path is not None:
                with store_errors(what, missing=True):  # of a disk SQLite says only that its file cannot be opened
                    try_to_write(self.path.parent)
            raise StoreError(f"{what}: {_in_words(error)}") from error


def _another_attempt(row: VideoRow) -> dict[str, Any]:
    return {"state": "scheduled", "attempt": row.attempt + 1, "flow_run": None}


def _file_of(store: Store) -> Path:
    """Beside the store; for one in a bucket a file of this user and host, since its copies may be deleted."""
    if not is_bucket(store.location):
        return store.root / FILE
    data = Path(os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share")
    name = re.sub(r"[^A-Za-z0-9.]+", "-", store.location.removeprefix("s3://"))[:100]
    digest = hashlib.sha256(store.location.encode()).hexdigest()[:8]
    return data / "humanmm" / "batches" / f"{name}-{digest}.sqlite"


def _shared_url(text: str) -> sa.URL:
    try:
        url = sa.make_url(text)
        backend = url.get_backend_name()
    except sa.exc.ArgumentError:
        backend = ""
    if backend not in ("postgresql", "sqlite"):
        raise ConfigError(f"${DATABASE_URL} names no database; expected postgresql://user:password@host/name")
    return url.set(drivername="postgresql+pg8000") if backend == "postgresql" else url


def _engine(url: sa.URL) -> sa.Engine:
    with _OPENING:  # two threads would each make one, and the connections of the one that is forgotten stay open
        return _opened(url)


@functools.cache
def _opened(url: sa.URL) -> sa.Engine:
    if url.get_backend_name() == "sqlite":
        engine = sa.create_engine(url, poolclass=sa.NullPool, connect_args={"timeout": TIMEOUT_S})
        sa.event.listen(engine, "connect", _prepare_file)
        return engine
    try:
        engine = sa.create_engine(url, pool_pre_ping=True, connect_args={"timeout": TIMEOUT_S})
    except ModuleNotFoundError:
        raise ConfigError(f"${DATABASE_URL} needs pg8000: pip install 'humanmm[team]'") from None
    try:
        with engine.begin() as connection:
            connection.execute(sa.text("select pg_advisory_xact_lock(hashtext('humanmm_videos'))"))  # one host makes it
            VIDEOS.metadata.create_all(connection)
            if all(column["name"] != "hopeless" for column in sa.inspect(connection).get_columns(VIDEOS.name)):
                connection.execute(sa.text(_ADD_HOPELESS))
    except BaseException:
        engine.dispose()
        raise
    return engine


def _prepare_file(connection: sqlite3.Connection, record: object) -> None:
    """Make the table in a new file, and move into it what earlier versions kept in two tables."""
    if VIDEOS.name in _tables(connection):
        if "hopeless" not in _columns(connection, VIDEOS.name):
            with contextlib.suppress(sqlite3.OperationalError):  # another process was faster, or reading will fail
                connection.execute(_ADD_HOPELESS)
        with contextlib.suppress(sqlite3.OperationalError):  # an older file that cannot be written is read without it
            connection.execute(str(CreateIndex(_BY_RUN_DIR, if_not_exists=True)))
        return
    connection.execute("begin immediate")
    before = _tables(connection)
    if VIDEOS.name not in before:
        connection.execute(str(CreateTable(VIDEOS)))
        connection.execute(str(CreateIndex(_BY_STATE)))
        connection.execute(str(CreateIndex(_BY_RUN_DIR)))
    if {"video", "batch"} <= before:
        columns = _columns(connection, "video")
        taken = [name for name in _FIELDS if name in columns]
        added = {name: default for name, default in _FIELDS.items() if name not in columns}
        added |= {"store": "", "renewed": 0.0}
        connection.execute(
            f"insert into {VIDEOS.name} ({', '.join([*taken, *added, 'created'])}) "
            f"select {', '.join(f'video.{name}' for name in taken)}, {', '.join('?' * len(added))}, batch.created "
            "from video join batch on batch.name = video.batch",
            list(added.values()),
        )
        connection.execute("drop table video")
        connection.execute("drop table batch")
    connection.commit()


def _columns(connection: sqlite3.Connection, table: str) -> set[str]:
    return {str(name) for _, name, *_ in connection.execute(f"pragma table_info({table})")}


def _tables(connection: sqlite3.Connection) -> set[str]:
    return {str(name) for (name,) in connection.execute("select name from sqlite_master where type = 'table'")}


def _in_words(error: Exception) -> str:
    """What the database's driver says, without the statement and its values."""
    cause = getattr(error, "orig", None) or error
    detail = cause.args[0] if cause.args else ""
    return str(detail["M"] if isinstance(detail, dict) and "M" in detail else cause)
