"""The batch table in SQLite and in Postgres: nothing that was written is lost, and one process owns a video."""

import errno
import multiprocessing
import os
import signal
import sqlite3
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from humanmm.errors import ConfigError, StoreError
from humanmm.storage.batches import batch_table
from humanmm.storage.batches import owner as owners
from humanmm.storage.batches.batch_table import DATABASE_URL, FILE, BatchTable, open_batches
from humanmm.storage.batches.owner import LEASE_S, Owner
from humanmm.storage.batches.video_row import VideoRow, counts

NUM_VIDEOS = 200
Process = Callable[[], BatchTable]


def _rows(count: int = NUM_VIDEOS, **values: Any) -> list[VideoRow]:
    return [
        VideoRow("b", f"/v/{i:05d}.mp4", i, f"/r/{i}", "{}", "normal", "[]", "", "", **values) for i in range(count)
    ]


@pytest.fixture(params=["sqlite", "postgres"])
def process(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Process:
    """The batches of a store as one more process opens them."""
    if request.param == "postgres":
        monkeypatch.setenv(DATABASE_URL, request.getfixturevalue("postgres_url"))
    return lambda: open_batches(tmp_path / "store")


def test_threads_that_open_a_database_at_once_share_its_connections(process: Process) -> None:
    """A second engine would be forgotten with its connections open: an unclosed socket, found by a later test."""
    batch_table._engine(process()._url).dispose()
    batch_table._opened.cache_clear()
    made: list[int] = []
    create = batch_table.sa.create_engine

    def slow(*given: Any, **named: Any) -> Any:
        made.append(1)
        time.sleep(0.2)
        return create(*given, **named)

    with pytest.MonkeyPatch.context() as patched, ThreadPoolExecutor(4) as threads:
        patched.setattr(batch_table.sa, "create_engine", slow)
        list(threads.map(lambda table: table.names(), [process() for _ in range(4)]))
        list(threads.map(lambda table: table.put(_rows(1)), [process() for _ in range(4)]))
    assert len(made) == 1


def test_two_who_submit_the_same_batch_at_once_leave_every_video_once(process: Process) -> None:
    with ThreadPoolExecutor(2) as threads:
        first, second = threads.map(lambda table: table.put(_rows()), [process(), process()])
    assert first == second == process().rows("b") and len(first) == NUM_VIDEOS


def test_a_new_attempt_replaces_a_row_and_an_old_one_does_not(process: Process) -> None:
    table = process()
    table.put(_rows(2, attempt=2, reason="second"))
    (first, other) = table.put([_rows(1, attempt=1, reason="first")[0], _rows(2, attempt=3, reason="third")[1]])
    assert (first.attempt, first.reason) == (2, "second") and (other.attempt, other.reason) == (3, "third")


def test_of_all_who_change_one_video_at_once_exactly_one_does_and_no_other_video_is_lost(process: Process) -> None:
    process().put(_rows(6))
    begin = threading.Barrier(6)

    def work(number: int) -> list[bool]:
        table = process()
        rows = table.rows("b")
        begin.wait()
        taken = [table.change(row, only_from=("scheduled",), state="running", stage=str(number)) for row in rows]
        assert table.change(rows[number], reason=f"written by {number}")
        return taken

    with ThreadPoolExecutor(6) as threads:
        taken = list(threads.map(work, range(6)))
    assert [sum(column) for column in zip(*taken, strict=True)] == [1] * 6
    ended = process().rows("b")
    assert [row.reason for row in ended] == [f"written by {number}" for number in range(6)]
    assert all(taken[int(row.stage or -1)][row.position] for row in ended)


def _claim(place: str, begin: Any, claims: Any) -> None:
    table = open_batches(place)
    row = table.rows("b")[0]
    begin.wait()
    claims.put(os.getpid() if table.claim(row) else 0)
    time.sleep(120)


def test_of_processes_that_claim_a_video_at_once_one_owns_it_until_it_is_killed(process: Process) -> None:
    table = process()
    table.put(_rows(1))
    context = multiprocessing.get_context("spawn")
    begin, claims = context.Barrier(4), context.Queue()
    place = str(table.store.location)
    children = [context.Process(target=_claim, args=(place, begin, claims)) for _ in range(4)]
    for child in children:
        child.start()
    owned = sorted(claims.get(timeout=120) for _ in children)
    assert owned[:3] == [0, 0, 0] and owned[3] > 0
    (row,) = table.rows("b")
    assert row.state == "running" and row.pid == owned[3] and row.is_owned and table.find_lost("b") == []
    os.kill(owned[3], signal.SIGKILL)
    for child in children:
        if child.pid == owned[3]:
            child.join(30)
    began = time.monotonic()
    assert [lost.video for lost in table.find_lost("b")] == [row.video]
    assert time.monotonic() - began < 1, "the kernel of its machine says so at once"
    (again,) = table.unscheduled()
    assert (again.attempt, again.losses) == (2, 1) and "its process was lost" in again.reason
    assert table.claim(again), "another process goes on"
    for child in children:
        child.kill()
        child.join(30)


def test_a_video_of_another_machine_is_taken_over_when_its_lease_has_run_out_and_not_before(
    process: Process, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = process()
    (row,) = table.put(_rows(1))
    with monkeypatch.context() as there:
        there.setattr(owners, "machine_name", lambda: "another")
        assert table.claim(row)
        assert table.renew(row)
    assert table.find_lost("b") == [] and not table.claim(row), "its lease is fresh"
    assert table.rows("b")[0].pid is None
    _age_lease(table, row, LEASE_S + 1)
    assert [lost.video for lost in table.find_lost("b")] == [row.video]
    (again,) = table.unscheduled()
    assert table.claim(again)
    with monkeypatch.context() as there:
        there.setattr(owners, "machine_name", lambda: "another")
        assert not table.renew(row), "an owner that was suspended sees that it is no longer wanted"
        table.release(row, seconds=1.0)
    (now,) = table.rows("b")
    assert now.owner == str(Owner.this_process()) and now.seconds is None, "and changes nothing of its successor's"


def test_on_one_machine_neither_a_lease_nor_a_clock_is_needed(
    process: Process, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = process()
    (row,) = table.put(_rows(1))
    assert table.claim(row)
    _age_lease(table, row, 10 * LEASE_S)
    assert process().rows("b")[0].is_owned, "a suspended process, or one that cannot write on a full disk, lives"
    clock = time.time
    monkeypatch.setattr(time, "time", lambda: clock() + 7200)
    assert process().rows("b")[0].is_owned


def test_the_clock_of_the_database_counts_and_not_those_of_hosts(
    postgres_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(DATABASE_URL, postgres_url)
    table = open_batches(tmp_path / "store")
    (row,) = table.put(_rows(1))
    with monkeypatch.context() as there:
        there.setattr(owners, "machine_name", lambda: "another")
        assert table.claim(row)
    clock = time.time
    monkeypatch.setattr(time, "time", lambda: clock() + 7200)
    assert table.rows("b")[0].is_owned and table.find_lost("b") == []


def test_a_cancelled_video_is_not_claimed_and_its_owner_learns_it(process: Process) -> None:
    table = process()
    first, second = table.put(_rows(2))
    table.change(first, state="cancelled")
    assert not table.claim(first)
    assert table.claim(second) and table.renew(second)
    table.change(second, state="cancelled")
    assert not table.renew(second)
    assert table.release(second) and not table.rows("b")[1].is_owned


def test_a_new_attempt_waits_for_the_owner_of_the_one_before(process: Process) -> None:
    table = process()
    (row,) = table.put(_rows(1))
    assert table.claim(row)
    (again,) = table.put(_rows(1, attempt=2))
    assert again.is_owned and not table.claim(again)
    table.release(row)
    assert table.claim(again)


def test_a_table_of_an_earlier_version_gets_the_column_it_lacks(process: Process) -> None:
    table = process()
    table.put(_rows(2))
    with batch_table._engine(table._url).begin() as connection:
        connection.execute(batch_table.sa.text(f"alter table {batch_table.VIDEOS.name} drop column hopeless"))
    batch_table._engine(table._url).dispose()
    batch_table._opened.cache_clear()
    row, _ = process().rows("b")
    assert row.hopeless is False
    assert process().change(row, hopeless=True) and process().rows("b")[0].hopeless is True


def test_queries_over_all_batches(process: Process) -> None:
    table = process()
    rows = table.put(_rows(4))
    table.change(rows[0], state="done", host="here")
    table.change(rows[1], state="running")
    table.change(rows[2], flow_run="one")
    assert table.running_batches() == ["b"] and [row.video for row in table.unscheduled()] == ["/v/00003.mp4"]
    ((key, (run_dir, host, ended)),) = table.finished({}).items()
    assert (key, run_dir, host) == (("/v/00000.mp4", "", ""), "/r/0", "here") and 0 <= time.time() - ended < 60
    assert list(table.last_changes()) == ["b"]
    assert counts(table.rows("b")) == {"scheduled": 2, "running": 1, "done": 1}
    assert [row.position for row in table.rows("b", "done", "running")] == [0, 1]


def test_names_are_anything_and_the_newest_is_first(process: Process) -> None:
    names = ["a/../b", "tänze & co %2F", "x" * 300]
    for name in names:
        process().put([VideoRow(name, "/v/ü.mp4", 0, "/r", "{}", "normal", "[]", "", "")])
    process().put([VideoRow(names[0], "/v/2.mp4", 1, "/r", "{}", "normal", "[]", "", "")])
    assert process().names() == names[::-1] and process().newest() == names[2]
    assert [row.video for row in process().rows(names[0])] == ["/v/ü.mp4", "/v/2.mp4"]


def test_stores_of_one_database_do_not_see_each_other(
    postgres_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(DATABASE_URL, postgres_url)
    open_batches(tmp_path / "one").put(_rows(1))
    assert open_batches(tmp_path / "two").names() == [] and open_batches(tmp_path / "two").unscheduled() == []


def test_a_moved_store_still_has_its_batches(tmp_path: Path) -> None:
    open_batches(tmp_path / "one").put(_rows(3))
    (tmp_path / "one").rename(tmp_path / "two")
    assert len(open_batches(tmp_path / "two").rows("b")) == 3


def test_to_look_at_a_store_without_batches_writes_nothing(tmp_path: Path) -> None:
    table = open_batches(tmp_path / "store")
    assert table.names() == [] and table.rows("b") == [] and table.unscheduled() == []
    assert not (tmp_path / "store" / FILE).exists()


def test_batches_of_a_bucket_lie_on_this_host_unless_a_database_is_named(
    bucket: str, request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = open_batches(bucket)
    assert table.path is not None and table.path.is_relative_to(tmp_path) and bucket[5:15] in table.path.name
    table.put(_rows(1))
    assert open_batches(bucket).names() == ["b"] and open_batches(f"{bucket}/other").names() == []
    monkeypatch.setenv(DATABASE_URL, request.getfixturevalue("postgres_url"))
    shared = open_batches(bucket)
    assert shared.path is None and shared.names() == []
    shared.put(_rows(2))
    assert [len(table.rows("b")), len(open_batches(bucket).rows("b"))] == [1, 2]


OLD_FILE = """
create table batch (name text primary key, source text, created real);
create table video (
    batch text, video text, position integer, run_dir text, config text, priority text, tags text,
    facts text, recipe text, attempt integer, state text, stage text, reason text, seconds real,
    flow_run text, pid integer, changed real{more},
    primary key (batch, video)
);
create index video_state on video (batch, state);
insert into batch values ('new', '/films', 200.0), ('old', '/films', 100.0);
insert into video (batch, video, position, run_dir, config, priority, tags, facts, recipe, attempt, state, stage,
    reason, seconds, flow_run, pid, changed)
values ('old', '/v/a.mp4', 0, '/r/a', '{{}}', 'high', '["x"]', '[1]', 'abc', 3, 'done', 'deliver',
        '', 2.5, 'f', 12, 150.0),
    ('old', '/v/b.mp4', 1, '/r/b', '{{}}', 'normal', '[]', '[2]', 'abc', 1, 'failed', 'people',
        'no people', null, 'g', 13, 160.0),
    ('new', '/v/a.mp4', 0, '/r/a', '{{}}', 'normal', '[]', '[1]', 'abc', 1, 'scheduled', null,
        '', null, null, null, 200.0);
"""


@pytest.mark.parametrize("more", ["", ", losses integer default 0, host text default ''"])
def test_the_file_of_an_earlier_version_is_converted_and_nothing_is_lost(tmp_path: Path, more: str) -> None:
    (tmp_path / "store").mkdir()
    with sqlite3.connect(tmp_path / "store" / FILE) as connection:
        connection.executescript(OLD_FILE.format(more=more))
    connection.close()
    with ThreadPoolExecutor(4) as threads:  # whoever opens it first
        found = list(threads.map(lambda _: open_batches(tmp_path / "store").rows("old"), range(8)))
    assert all(rows == found[0] for rows in found)
    done, failed = found[0]
    assert (done.attempt, done.state, done.seconds, done.tags, done.priority) == (3, "done", 2.5, '["x"]', "high")
    assert (done.losses, done.host, done.owner, done.changed) == (0, "", "", 150.0)
    assert (failed.state, failed.stage, failed.reason) == ("failed", "people", "no people")
    table = open_batches(tmp_path / "store")
    assert table.names() == ["new", "old"] and [row.batch for row in table.unscheduled()] == ["new"]
    assert table.finished({}) == {("/v/a.mp4", "[1]", "abc"): ("/r/a", "", 150.0)}


def test_a_writer_that_is_killed_leaves_all_or_nothing(tmp_path: Path) -> None:
    script = (
        "import sys\nfrom humanmm.storage.batches.batch_table import open_batches\n"
        "from humanmm.storage.batches.video_row import VideoRow\n"
        "rows = [VideoRow('b', f'/v/{i}', i, '/r', '{}', 'normal', '[]', '', '') for i in range(20000)]\n"
        "table = open_batches(sys.argv[1])\nprint(flush=True)\ntable.put(rows)\n"
    )
    for delay_s in (0.02, 0.1, 0.3):
        store = tmp_path / f"{delay_s}"
        with subprocess.Popen([sys.executable, "-c", script, str(store)], stdout=subprocess.PIPE, text=True) as writer:
            assert writer.stdout is not None and writer.stdout.readline()
            time.sleep(delay_s)
            writer.kill()
        assert writer.returncode in (0, -signal.SIGKILL), "it failed before it was killed"
        assert len(open_batches(store).rows("b")) in (0, 20000)
        assert len(open_batches(store).put(_rows(2))) == 2, "and whoever comes next can write"


def test_a_file_that_is_no_database_and_a_database_that_is_not_there_are_one_clear_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / FILE).write_text("this is no database, and never was one")
    with pytest.raises(StoreError, match=rf"cannot read the batches of the store, {tmp_path / FILE}: file is not a"):
        open_batches(tmp_path).rows("b")
    monkeypatch.setenv(DATABASE_URL, "mysql://somewhere/else")
    with pytest.raises(ConfigError, match="expected postgresql://user:password@host/name"):
        open_batches(tmp_path)
    pytest.importorskip("pg8000")
    monkeypatch.setenv(DATABASE_URL, "postgresql://me:secret@127.0.0.1:1/none")
    with pytest.raises(StoreError, match="cannot write the batches of the store, postgresql") as message:
        open_batches(tmp_path).put(_rows(1))
    assert "secret" not in str(message.value)


def _age_lease(table: BatchTable, row: VideoRow, seconds: float) -> None:
    """Have the last renewal lie so far back."""
    from humanmm.storage.batches.batch_table import VIDEOS

    assert table._update(row, renewed=VIDEOS.c.renewed - seconds)


def test_of_a_store_on_a_read_only_disk_it_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    table = open_batches(tmp_path / "store")
    (tmp_path / "store" / "batches.sqlite").mkdir(parents=True)  # SQLite cannot open it, as on such a disk

    def refuse(**options: object) -> None:
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr("tempfile.NamedTemporaryFile", refuse)
    with pytest.raises(StoreError, match=r"batches.sqlite: the disk is read-only; name another store with --store"):
        table.put([VideoRow("b", "/v/a.mp4", 0, "/r/a", "{}", "normal", "[]", "", "")])


def test_run_folders_have_an_index_in_files_of_earlier_versions_too(tmp_path: Path) -> None:
    index = "select count(*) from sqlite_master where name = 'humanmm_videos_by_run_dir'"
    open_batches(tmp_path).put(_rows(1))
    with sqlite3.connect(tmp_path / FILE) as earlier:
        assert earlier.execute(index).fetchone() == (1,)
        earlier.execute("drop index humanmm_videos_by_run_dir")
    assert open_batches(tmp_path).rewritten() == {}
    with sqlite3.connect(tmp_path / FILE) as later:
        assert later.execute(index).fetchone() == (1,)
