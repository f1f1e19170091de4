"""The ledger of batches of a store in a bucket: objects beside it, for as many hosts as submit, compute and ask.

    batches/<batch>/head      name and source of a batch, and when it was made; written once
    batches/<batch>/<00…3f>   its videos, spread over 64 objects by a hash of their paths: gzip of json

A change is a conditional put of the object that holds the video, begun anew when somebody else was faster, so that
nothing that was written is ever lost; 64 objects, so that this is rare with hundreds of processes. What was read is
kept by its entity tag: to look at 10,000 videos again is one listing and what has changed since.
"""

import gzip
import hashlib
import json
import random
import sys
import time
import uuid
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

from humanmm.errors import StoreError
from humanmm.storage.batches.batch_ledger import AT_A_TIME, STATES, BatchLedger, VideoRow
from humanmm.storage.store.bucket_store import BucketStore

T = TypeVar("T")
U = TypeVar("U")

FOLDER = "batches"
_PARTS = 64
_MOST_WAIT_S = 0.1
_NAMES = [field.name for field in fields(VideoRow)]

Rows = dict[str, VideoRow]
"""Path of a video → its row."""


@dataclass(frozen=True)
class _Part:
    """One object with videos, as it was read."""

    tag: str | None
    """None if it is not there yet."""
    writer: str
    """Who wrote it: a put whose answer was lost is known by it."""
    rows: Rows


_NOTHING = _Part(None, "", {})


class BucketLedger(BatchLedger):
    """The batches of one store in a bucket."""

    def __init__(self, store: BucketStore) -> None:
        super().__init__(store)
        self._bucket = store.bucket
        self._parts: dict[str, _Part] = {}
        self._heads: dict[str, dict[str, Any]] = {}

    # ---- batches

    def put(self, name: str, source: str, rows: Sequence[VideoRow]) -> list[VideoRow]:
        """Each object at once, see `BatchLedger.put`."""
        now = time.time()
        head = json.dumps({"name": name, "source": source, "created": now})
        self._bucket.create(f"{_folder(name)}/head", head.encode())
        parts: dict[str, Rows] = {}
        for row in rows:
            parts.setdefault(_part_name(name, row.video), {})[row.video] = replace(row, changed=now)

        def write(part: tuple[str, Rows]) -> Rows:
            at, asked = part

            def add(known: Rows) -> bool:
                fresh = {
                    video: row
                    for video, row in asked.items()
                    if video not in known or row.attempt > known[video].attempt
                }
                known.update(fresh)
                return bool(fresh)

            self._edit(at, add)
            return self._parts[at].rows

        standing: Rows = {}
        for found in _side_by_side(write, list(parts.items())):
            standing |= found
        return [standing[row.video] for row in rows]

    def names(self) -> list[str]:
        heads = sorted(self._known_batches().values(), key=lambda head: -float(head["created"]))
        return [str(head["name"]) for head in heads]

    def rows(self, batch: str, *states: str) -> list[VideoRow]:
        found = [row for row in self._all_rows(_folder(batch)) if not states or row.state in states]
        return sorted(found, key=lambda row: (row.position, row.video))

    def row(self, batch: str, video: str) -> VideoRow | None:
        return self._read(_part_name(batch, video)).rows.get(video)

    def finished(self) -> dict[tuple[str, str, str], tuple[str, str]]:
        rows = (row for row in self._all_rows(FOLDER) if row.state == "done")
        return {(row.video, row.facts, row.recipe): (row.run_dir, row.host) for row in rows}

    def unscheduled(self, limit: int = 200) -> list[VideoRow]:
        waiting = [row for row in self._all_rows(FOLDER) if row.state == "scheduled" and row.flow_run is None]
        return waiting[:limit]

    def last_changes(self) -> dict[str, float]:
        last: dict[str, float] = {}
        for row in self._all_rows(FOLDER):
            last[row.batch] = max(row.changed, last.get(row.batch, 0.0))
        return last

    def batches_at_work(self) -> list[str]:
        return sorted({row.batch for row in self._all_rows(FOLDER) if row.state == "running"})

    # ---- one video

    def change(self, row: VideoRow, *, only_from: Iterable[str] = STATES, **values: Any) -> bool:
        states = tuple(only_from)
        if "state" in values:
            values["changed"] = time.time()

        def apply(known: Rows) -> bool:
            found = known.get(row.video)
            if found is None or found.attempt != row.attempt or found.state not in states:
                return False
            known[row.video] = replace(found, **values)
            return True

        return self._edit(_part_name(row.batch, row.video), apply)

    # ---- the objects

    def _edit(self, at: str, change: Callable[[Rows], bool]) -> bool:
        """Change the videos of one object, whoever else does at the same time; False if nothing is to be changed."""
        writer = uuid.uuid4().hex
        while True:
            found = self._read(at)
            if found.writer == writer:  # our put arrived, its answer did not
                return True
            rows = dict(found.rows)
            if not change(rows):
                return False
            content = _packed(writer, rows)
            if found.tag is None:
                tag = self._bucket.create(at, content)
            else:
                tag = self._bucket.replace(at, content, found.tag)
            if tag is not None:
                self._parts[at] = _Part(tag, writer, rows)
                return True
            time.sleep(random.uniform(0.0, _MOST_WAIT_S))

    def _read(self, at: str) -> _Part:
        found = self._bucket.read(at)
        if found is None:
            return _NOTHING
        content, state = found
        known = self._parts.get(at)
        if known is None or known.tag != state.tag:
            known = _unpacked(at, content, state.tag)
            self._parts[at] = known
        return known

    def _all_rows(self, folder: str) -> Iterator[VideoRow]:
        """Every video below a folder; only what has changed since it was read last is read."""
        objects = [found for found in self._bucket.list(folder) if not found.name.endswith("/head")]

        def rows(at: str, tag: str) -> Rows:
            known = self._parts.get(at)
            return known.rows if known is not None and known.tag == tag else self._read(at).rows

        for found in _side_by_side(lambda o: rows(o.name, o.tag), objects):
            yield from found.values()

    def _known_batches(self) -> dict[str, dict[str, Any]]:
        """Where the head of a batch lies → what it says; a head never changes."""
        heads = [found.name for found in self._bucket.list(FOLDER) if found.name.endswith("/head")]
        fresh = [at for at in heads if at not in self._heads]
        for at, found in zip(fresh, _side_by_side(self._bucket.read, fresh), strict=True):
            if found is not None:
                self._heads[at] = json.loads(found[0])
        return {at: self._heads[at] for at in heads if at in self._heads}


def _side_by_side(function: Callable[[T], U], items: Sequence[T]) -> list[U]:
    with ThreadPoolExecutor(AT_A_TIME) as threads:
        return list(threads.map(function, items))


def _folder(batch: str) -> str:
    """Where a batch lies: names are anything, keys of objects are not."""
    return f"{FOLDER}/{hashlib.sha256(batch.encode()).hexdigest()[:32]}"


def _part_name(batch: str, video: str) -> str:
    return f"{_folder(batch)}/{hashlib.sha256(video.encode()).digest()[0] % _PARTS:02x}"


def _packed(writer: str, rows: Rows) -> bytes:
    tree = {
        "writer": writer,
        "fields": _NAMES,
        "rows": [[getattr(row, name) for name in _NAMES] for row in rows.values()],
    }
    return gzip.compress(json.dumps(tree).encode(), compresslevel=1, mtime=0)


def _unpacked(at: str, content: bytes, tag: str) -> _Part:
    try:
        tree = json.loads(gzip.decompress(content))
        rows = [VideoRow(**dict(zip(tree["fields"], values, strict=True))) for values in tree["rows"]]
    except (OSError, EOFError, ValueError, KeyError, TypeError) as error:
        raise StoreError(f"the object {at} of the ledger of batches cannot be read: {error}") from error
    # thousands of rows have the same few configurations
    return _Part(tag, str(tree["writer"]), {row.video: replace(row, config=sys.intern(row.config)) for row in rows})
