"""Batches of a store in a bucket: nothing that was written is lost, and to look again costs what has changed."""

import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

from humanmm.errors import StoreError
from humanmm.storage.batches import bucket_ledger
from humanmm.storage.batches.batch_ledger import BatchLedger, VideoRow, counts
from humanmm.storage.batches.bucket_ledger import BucketLedger
from humanmm.storage.store import locks
from humanmm.storage.store.bucket import Bucket
from humanmm.storage.store.bucket_store import BucketStore

NUM_VIDEOS = 200


def _rows(count: int = NUM_VIDEOS, **values: Any) -> list[VideoRow]:
    return [
        VideoRow("b", f"/v/{i:05d}.mp4", i, f"/r/{i}", "{}", "normal", "[]", "", "", **values) for i in range(count)
    ]


@pytest.fixture
def host(bucket: str) -> Callable[[], BatchLedger]:
    """The ledger as one more process sees it."""
    return lambda: BucketLedger(BucketStore(bucket))


def test_two_who_submit_the_same_batch_at_once_leave_every_video_once(host: Callable[[], BatchLedger]) -> None:
    with ThreadPoolExecutor(2) as threads:
        first, second = threads.map(lambda ledger: ledger.put("b", "/v", _rows()), [host(), host()])
    assert first == second == host().rows("b") and len(first) == NUM_VIDEOS


def test_of_all_who_change_one_video_at_once_exactly_one_does_and_no_other_video_is_lost(
    host: Callable[[], BatchLedger], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bucket_ledger, "_PARTS", 1)  # all in each other's way
    host().put("b", "/v", _rows(6))
    begin = threading.Barrier(6)

    def work(number: int) -> list[bool]:
        ledger = host()
        rows = ledger.rows("b")
        begin.wait()
        taken = [ledger.change(row, only_from=("scheduled",), state="running", pid=number) for row in rows]
        assert ledger.change(rows[number], reason=f"told by {number}")
        return taken

    with ThreadPoolExecutor(6) as threads:
        taken = list(threads.map(work, range(6)))
    assert [sum(column) for column in zip(*taken, strict=True)] == [1] * 6
    ended = host().rows("b")
    assert [row.reason for row in ended] == [f"told by {number}" for number in range(6)]
    assert all(taken[row.pid or 0][row.position] for row in ended)


def test_a_change_whose_answer_was_lost_on_the_way_counts(
    host: Callable[[], BatchLedger], monkeypatch: pytest.MonkeyPatch
) -> None:
    ledger = host()
    (row,) = ledger.put("b", "/v", _rows(1))
    replaced = Bucket.replace

    def deaf(self: Bucket, name: str, content: bytes, tag: str) -> str | None:
        monkeypatch.setattr(Bucket, "replace", replaced)
        replaced(self, name, content, tag)
        return None  # as when it is sent again: its own tag is no longer that which it names

    monkeypatch.setattr(Bucket, "replace", deaf)
    assert ledger.change(row, only_from=("scheduled",), state="running")
    assert counts(host().rows("b")) == {"running": 1}


def test_to_look_again_reads_what_has_changed(host: Callable[[], BatchLedger], monkeypatch: pytest.MonkeyPatch) -> None:
    host().put("b", "/v", _rows())
    ledger, other = host(), host()
    before = ledger.rows("b")
    read: list[str] = []
    reading = Bucket.read
    with monkeypatch.context() as patched:
        patched.setattr(Bucket, "read", lambda self, name: read.append(name) or reading(self, name))
        assert ledger.rows("b") == before and read == []
        assert other.change(before[7], state="done")
        read.clear()
        assert counts(ledger.rows("b")) == {"scheduled": NUM_VIDEOS - 1, "done": 1}
        assert len(read) == 1
        assert ledger.batches_at_work() == [] and len(ledger.unscheduled(1000)) == NUM_VIDEOS - 1
        assert list(ledger.last_changes()) == ["b"] and list(ledger.finished()) == [("/v/00007.mp4", "", "")]
        assert len(read) == 1


def test_names_are_anything_and_the_newest_is_first(host: Callable[[], BatchLedger]) -> None:
    names = ["a/../b", "tänze & co %2F", "x" * 300]
    for name in names:
        host().put(name, "/v", _rows(1))
    assert host().names() == names[::-1] and host().newest() == names[2]
    assert [row.video for row in host().rows(names[0])] == ["/v/00000.mp4"]


def test_whether_a_process_lives_is_told_by_the_clock_of_the_bucket_alone(
    host: Callable[[], BatchLedger], monkeypatch: pytest.MonkeyPatch
) -> None:
    ledger = host()
    (row,) = ledger.put("b", "/v", _rows(1))
    with ledger.hold(row) as held:
        assert held
        now = time.time
        monkeypatch.setattr(time, "time", lambda: now() + 7200)  # this host's clock is far off
        assert host().is_held(row)
        with host().hold(row) as second:
            assert not second
    Bucket(ledger.store.location).write(f"locks/video-{row.lock_key}", b"dead-host 1 0123 4")
    assert host().is_held(row)
    monkeypatch.setattr(locks, "LEASE_S", 0.0)
    monkeypatch.setattr(locks, "MARGIN_S", 0.0)
    time.sleep(2)  # the clock of the service tells whole seconds
    assert not host().is_held(row)
    with host().hold(row) as held:
        assert held


def test_a_damaged_object_of_the_ledger_is_one_clear_error(host: Callable[[], BatchLedger]) -> None:
    ledger = host()
    ledger.put("b", "/v", _rows(1))
    (part,) = [o.name for o in Bucket(ledger.store.location).list("batches") if not o.name.endswith("/head")]
    Bucket(ledger.store.location).write(part, b"no gzip")
    with pytest.raises(StoreError, match="of the ledger of batches cannot be read"):
        host().rows("b")
