"""What of a batch is scheduled, what is finished already, and where each video's run folder goes."""

import hashlib
import json
import os
import signal
import socket
import sqlite3
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from humanmm.config import Config
from humanmm.errors import ConfigError, InputError, StageError, StoreError
from humanmm.storage.batches import bucket_ledger
from humanmm.storage.batches.batch_ledger import BatchLedger, VideoRow, counts
from humanmm.storage.batches.bucket_ledger import BucketLedger
from humanmm.storage.batches.disk_ledger import DiskLedger
from humanmm.storage.batches.manifest import read_batch
from humanmm.storage.pages.batch_report import write_report
from humanmm.storage.store import locks
from humanmm.storage.store.bucket import is_bucket
from humanmm.storage.store.bucket_store import BucketStore
from humanmm.storage.store.open import open_ledger
from humanmm.tasks.batches import batch as batches
from humanmm.tasks.engine import finish


@pytest.fixture
def toy(any_toy: Any) -> Any:
    """Everything here is so on a store of each kind."""
    return any_toy


@pytest.fixture
def ledger(toy: Any) -> BatchLedger:
    return open_ledger(toy.store)


def _submit(toy: Any, ledger: BatchLedger, source: Path, **settings: Any) -> batches.Submission:
    config = Config.model_validate(settings)
    return batches.submit(ledger, "test", source, read_batch(source), config, toy.folder / "runs")


def _films(toy: Any, *names: str) -> Path:
    for number, name in enumerate(names):
        path = Path(toy.folder / "films" / name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps({"num_frames": 60 + number, "cuts": [20, 40]}))
    return Path(toy.folder / "films")


def _end(ledger: BatchLedger, row: VideoRow, state: str, reason: str = "", stage: str | None = None) -> None:
    assert ledger.change(row, state=state, reason=reason, stage=stage, seconds=2.0)
    if state in ("done", "partial"):
        Path(row.run_dir).mkdir(parents=True)
        Path(row.run_dir, "run.json").write_text("{}")


def test_the_same_batch_twice_schedules_nothing_new(toy: Any, ledger: BatchLedger) -> None:
    films = _films(toy, "a.mp4", "b.mp4", "c.mp4")
    first = _submit(toy, ledger, films)
    assert [(Path(row.video).name, row.attempt) for row in first.to_schedule] == [
        ("a.mp4", 1), ("b.mp4", 1), ("c.mp4", 1),
    ]  # fmt: skip
    _end(ledger, first.to_schedule[0], "done")
    _end(ledger, first.to_schedule[1], "failed", "no people")
    again = _submit(toy, ledger, films)
    assert [(Path(row.video).name, row.attempt) for row in again.to_schedule] == [("c.mp4", 1)]
    assert (again.finished, again.failed) == (1, 1)


def test_a_new_video_a_changed_one_and_changed_settings_are_scheduled(toy: Any, ledger: BatchLedger) -> None:
    films = _films(toy, "a.mp4", "b.mp4")
    for row in _submit(toy, ledger, films).to_schedule:
        _end(ledger, row, "done")
    (films / "new.mp4").write_text("{}")
    (films / "b.mp4").write_text('{"num_frames": 70, "cuts": []}')
    asked = _submit(toy, ledger, films).to_schedule
    assert [(Path(row.video).name, row.attempt) for row in asked] == [("b.mp4", 2), ("new.mp4", 1)]
    assert len(_submit(toy, ledger, films, camera={"static": True}).to_schedule) == 3
    for row in ledger.rows("test"):
        ledger.change(row, state="done")
        Path(row.run_dir).mkdir(exist_ok=True)
        Path(row.run_dir, "run.json").touch()
    assert _submit(toy, ledger, films, camera={"static": True}, run={"threads": 1}).finished == 3, "same result"


def test_a_video_that_recover_finished_is_not_scheduled_and_its_folder_is_written(
    toy: Any, ledger: BatchLedger
) -> None:
    toy.run()
    films = toy.folder / "films"
    films.mkdir()
    toy.video.rename(films / "film.mp4")
    assert toy.main("recover", "films/film.mp4", "--out", "elsewhere")[0] == 0
    submission = _submit(toy, ledger, films)
    assert (submission.to_schedule, submission.finished) == ((), 1)
    assert json.loads((toy.folder / "runs/film/run.json").read_text())["state"] == "done"


def test_what_recover_finished_as_the_batch_wants_it_is_known_by_one_record(
    toy: Any, ledger: BatchLedger, monkeypatch: pytest.MonkeyPatch
) -> None:
    toy.run()
    films = toy.folder / "films"
    films.mkdir()
    toy.video.rename(films / "film.mp4")
    assert toy.main("recover", str(films / "film.mp4"))[0] == 0
    looked_up: list[str] = []
    forecast = batches.forecast
    monkeypatch.setattr(batches, "forecast", lambda run: looked_up.append("all stages") or forecast(run))
    other = _submit(toy, ledger, films, camera={"static": True})
    assert len(other.to_schedule) == 1 and looked_up == ["all stages"], "with other settings it is not what is there"
    submission = _submit(toy, ledger, films)
    assert (submission.to_schedule, submission.finished, len(looked_up)) == ((), 1, 1)


def test_a_finished_video_whose_folder_is_gone_is_looked_up_in_the_store_again(toy: Any, ledger: BatchLedger) -> None:
    films = _films(toy, "a.mp4")
    (row,) = _submit(toy, ledger, films).to_schedule
    _end(ledger, row, "done")
    Path(row.run_dir, "run.json").unlink()
    (again,) = _submit(toy, ledger, films).to_schedule
    assert again.attempt == 2


def test_videos_of_one_name_get_folders_by_their_content(toy: Any, ledger: BatchLedger) -> None:
    films = _films(toy, "x/take.mp4", "y/take.mp4", "y/take.mov")
    rows = {Path(row.video): Path(row.run_dir).name for row in _submit(toy, ledger, films).to_schedule}
    digest = {path: hashlib.sha256(path.read_bytes()).hexdigest()[:8] for path in rows}
    assert sorted(rows.values()) == sorted(
        ["take", f"take-{digest[films / 'y/take.mov']}", f"take-{digest[films / 'y/take.mp4']}"]
    )
    again = {Path(row.video): Path(row.run_dir).name for row in _submit(toy, ledger, films).to_schedule}
    assert again == rows


def test_copies_of_one_video_under_one_name_still_get_a_folder_each(toy: Any, ledger: BatchLedger) -> None:
    films = _films(toy, "x/take.mp4", "y/take.mp4", "z/take.mp4")
    for folder in ("y", "z"):
        (films / folder / "take.mp4").write_bytes((films / "x/take.mp4").read_bytes())
    assert len({row.run_dir for row in _submit(toy, ledger, films).to_schedule}) == 3


def test_settings_of_one_video_reach_it_alone_and_a_bad_one_is_told(toy: Any, ledger: BatchLedger) -> None:
    films = _films(toy, "a.mp4", "b.mp4")
    (films / "m.csv").write_text("video,camera.static,shots.person\na.mp4,true,\nb.mp4,,1\n")
    first, second = _submit(toy, ledger, films / "m.csv", shots={"person": 0}).to_schedule
    assert json.loads(first.config)["camera"]["static"] is True and json.loads(first.config)["shots"]["person"] == 0
    assert json.loads(second.config)["camera"]["static"] is False and json.loads(second.config)["shots"]["person"] == 1
    (films / "m.csv").write_text("video,camera.statik\na.mp4,true\n")
    with pytest.raises(ConfigError, match=r"line 2: unknown setting camera.statik; did you mean static\?"):
        _submit(toy, ledger, films / "m.csv")
    (films / "m.csv").write_text("video,out\na.mp4,same\nb.mp4,same\n")
    with pytest.raises(InputError, match="is another video's"):
        batches.submit(ledger, "other", films, read_batch(films / "m.csv"), Config(), toy.folder / "runs")


def test_only_what_failed_in_a_stage_is_tried_again(toy: Any, ledger: BatchLedger) -> None:
    a, b, c, d = _submit(toy, ledger, _films(toy, "a.mp4", "b.mp4", "c.mp4", "d.mp4")).to_schedule
    _end(ledger, a, "partial", "no points", "camera · shot 1")
    _end(ledger, b, "failed", "no people", "people · scene 0")
    _end(ledger, c, "done")
    assert [row.video for row in batches.retry(ledger, "test", stage="camera")] == [a.video]
    assert [(row.video, row.attempt) for row in batches.retry(ledger, "test")] == [(b.video, 2)]
    assert counts(ledger.rows("test")) == {"scheduled": 3, "done": 1}
    assert not ledger.change(a, state="done"), "its first attempt has nothing to say any more"
    assert ledger.row("test", d.video) == ledger.rows("test")[3]


def _worker(toy: Any) -> subprocess.Popen[str]:
    """A process that holds the first video of the batch."""
    script = (
        "import sys, time\n"
        "from humanmm.storage.store.open import open_ledger\n"
        "from humanmm.tasks.batches import batch\n"
        "batch.LOOK_EVERY_S = batch.ASK_EVERY_S = 0.2\n"
        "ledger = open_ledger(sys.argv[1])\n"
        "with batch.Account(ledger, ledger.rows('test')[0]).kept('run') as ready:\n"
        "    print(ready, flush=True)\n"
        "    time.sleep(60)\n"
    )
    worker = subprocess.Popen(
        [sys.executable, "-c", script, str(toy.store)], env=toy.environment(), stdout=subprocess.PIPE, text=True
    )
    assert worker.stdout is not None and worker.stdout.readline() == "True\n"
    return worker


def test_a_running_video_whose_process_was_killed_is_found_lost(
    toy: Any, ledger: BatchLedger, monkeypatch: pytest.MonkeyPatch
) -> None:
    (row,) = _submit(toy, ledger, _films(toy, "a.mp4")).to_schedule
    worker = _worker(toy)
    assert ledger.find_lost("test") == []
    running = ledger.rows("test")[0]
    assert (running.state, running.pid, running.flow_run) == ("running", worker.pid, "run")
    with batches.Account(ledger, running).kept("other") as ready:
        assert not ready, "one video is never computed twice at the same time"
    os.kill(worker.pid, signal.SIGKILL)
    worker.wait()
    _close(worker)
    if is_bucket(ledger.store.location):  # its lease has to run out first
        assert locks.LEASE_S + locks.MARGIN_S < 60
        monkeypatch.setattr(locks, "LEASE_S", 0.0)
        monkeypatch.setattr(locks, "MARGIN_S", 1.0)
        time.sleep(2.5)
    began = time.monotonic()
    assert [lost.video for lost in ledger.find_lost("test")] == [row.video]
    assert time.monotonic() - began < 1
    (again,) = ledger.unscheduled()
    assert (again.state, again.attempt, again.losses) == ("scheduled", 2, 1) and "its process was lost" in again.reason


def test_a_process_ends_whose_video_was_cancelled_from_another_machine(toy: Any, ledger: BatchLedger) -> None:
    _submit(toy, ledger, _films(toy, "a.mp4"))
    worker = _worker(toy)
    (running,) = ledger.rows("test")
    assert running.host == socket.gethostname() and not running.is_elsewhere
    ledger.change(running, host="another", pid=os.getpid(), flow_run=None)
    done = toy.main("batch", "cancel", HUMANMM_CACHE=str(toy.folder / "cache"))
    assert done[0] == 0 and "1 on other machines end within a minute" in done[2], done
    assert worker.wait(timeout=60) == -signal.SIGTERM
    _close(worker)
    assert counts(ledger.rows("test")) == {"cancelled": 1}


def _close(worker: subprocess.Popen[str]) -> None:
    worker.wait()
    if worker.stdout is not None:
        worker.stdout.close()


def test_a_video_that_another_machine_has_finished_is_finished_here(toy: Any, ledger: BatchLedger) -> None:
    films = _films(toy, "a.mp4")
    (row,) = _submit(toy, ledger, films).to_schedule
    ledger.change(row, state="done", host="another")
    assert _submit(toy, ledger, films).finished == 1, "its run folder is there, where nobody can look"
    again = batches.submit(ledger, "other", films, read_batch(films), Config(), toy.folder / "runs")
    assert again.finished == 1
    page, _ = write_report(toy.folder / "report", "test", ledger.rows("test"))
    assert "its run folder is on another" in page.read_text()


def test_of_two_who_submit_at_once_the_first_counts_and_the_second_is_told(
    toy: Any, ledger: BatchLedger, monkeypatch: pytest.MonkeyPatch
) -> None:
    films = _films(toy, "a.mp4", "b.mp4")
    put = ledger.put

    def late(name: str, source: str, rows: Any) -> Any:
        monkeypatch.setattr(ledger, "put", put)
        (first, _) = _submit(toy, ledger, films).to_schedule
        assert ledger.change(first, state="running")
        return put(name, source, rows)

    monkeypatch.setattr(ledger, "put", late)
    assert [Path(row.video).name for row in _submit(toy, ledger, films).to_schedule] == ["b.mp4"]
    assert counts(ledger.rows("test")) == {"running": 1, "scheduled": 1}

    def other(name: str, source: str, rows: Any) -> Any:
        monkeypatch.setattr(ledger, "put", put)
        (films / "c.mp4").touch()
        _submit(toy, ledger, films, camera={"static": True})
        return put(name, source, rows)

    ledger.change(ledger.rows("test")[0], state="done")
    monkeypatch.setattr(ledger, "put", other)
    with pytest.raises(InputError, match="was submitted with other settings by somebody else just now"):
        _submit(toy, ledger, films)


def test_a_video_that_is_lost_again_and_again_fails(toy: Any, ledger: BatchLedger) -> None:
    _submit(toy, ledger, _films(toy, "a.mp4"))
    for attempt in (1, 2, 3):
        (row,) = ledger.rows("test")
        assert (row.state, row.attempt) == ("scheduled", attempt)
        ledger.change(row, state="running", stage="align")
        ledger.find_lost("test")
    (row,) = ledger.rows("test")
    assert (row.state, row.attempt) == ("failed", 3) and "lost during align" in row.reason
    assert ledger.unscheduled() == []
    (again,) = batches.retry(ledger, "test")
    assert (again.attempt, again.losses) == (4, 0)


def test_a_fault_of_the_store_has_a_video_tried_again_and_one_of_the_video_does_not(
    toy: Any, ledger: BatchLedger
) -> None:
    _submit(toy, ledger, _films(toy, "a.mp4"))
    for attempt in (1, 2, 3):
        (row,) = ledger.rows("test")
        assert (row.state, row.attempt, row.losses) == ("scheduled", attempt, attempt - 1)
        account = batches.Account(ledger, row)
        with account.kept(None) as ready:
            assert ready
            account.fail(StoreError("the disk is full"))
    (row,) = ledger.rows("test")
    assert (row.state, row.attempt, row.reason) == ("failed", 3, "the disk is full")
    (row,) = batches.retry(ledger, "test")
    account = batches.Account(ledger, row)
    with account.kept(None):
        account.fail(StageError("nobody is in it"))
    (row,) = ledger.rows("test")
    assert (row.state, row.attempt, row.reason) == ("failed", 4, "nobody is in it")


@pytest.mark.parametrize(
    ("faults", "ended"), [("camera:20=disk:9", "scheduled"), ("camera:20=disk:9;hmr:40=stage", "partial")]
)
def test_a_video_is_tried_again_if_nothing_but_faults_of_the_machine_took_its_shots(
    toy: Any, ledger: BatchLedger, monkeypatch: pytest.MonkeyPatch, faults: str, ended: str
) -> None:
    (row,) = _submit(toy, ledger, _films(toy, "a.mp4")).to_schedule
    monkeypatch.setenv("TOY_FAIL", faults)
    account = batches.Account(ledger, row)
    with account.kept(None):
        account.run = toy.run(expect_failure=True)
        account.end_partial("camera · shot 1: Input/output error")
    (row,) = ledger.rows("test")
    assert (row.state, row.stage) == (ended, "camera · shot 1")


def test_what_comes_of_a_fault_of_the_machine_is_told_as_that_fault(toy: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TOY_FAIL", "people:0=disk:9;shots=input")
    told = finish.fatal_error(toy.run(expect_failure=True))
    assert isinstance(told, StoreError) and "people · scene 0" in str(told)
    monkeypatch.setenv("TOY_FAIL", "people:0=stage;shots=input")
    told = finish.fatal_error(toy.run(expect_failure=True))
    assert isinstance(told, InputError) and "shots does not like its input" in str(told)


def test_losses_are_counted_anew_when_a_video_has_got_further(
    toy: Any, ledger: BatchLedger, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(batches, "LOOK_EVERY_S", 0.01)
    _submit(toy, ledger, _films(toy, "a.mp4"))
    (row,) = ledger.rows("test")
    for left in (0, 2):  # `decode` is computed the first time, and only found the second
        ledger.change(row, losses=2)
        account = batches.Account(ledger, replace(row, losses=2))
        with account.kept(None):
            account.run = toy.open()
            account.run.execute(account.run.unit("decode"))
            time.sleep(1.0)
        assert ledger.rows("test")[0].losses == left


def test_a_ledger_of_an_earlier_version_is_read(toy: Any, ledger: BatchLedger, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patched:
        names = [name for name in bucket_ledger._NAMES if name not in ("losses", "host")]
        patched.setattr(bucket_ledger, "_NAMES", names)
        _submit(toy, ledger, _films(toy, "a.mp4"))
    if isinstance(ledger, DiskLedger):
        with sqlite3.connect(ledger.path) as connection:
            for column in ("losses", "host"):
                connection.execute(f"alter table video drop column {column}")
    else:
        ledger = BucketLedger(BucketStore(ledger.store.location))
    (row,) = _submit(toy, ledger, _films(toy, "a.mp4", "b.mp4")).to_schedule[:1]
    assert (row.losses, row.host) == (0, "")


def test_a_cancelled_video_does_not_start_and_stays_cancelled(toy: Any, ledger: BatchLedger) -> None:
    a, b = _submit(toy, ledger, _films(toy, "a.mp4", "b.mp4")).to_schedule
    ledger.change(a, state="cancelled")
    with batches.Account(ledger, a).kept(None) as ready:
        assert not ready
    account = batches.Account(ledger, b)
    with account.kept(None) as ready:
        assert ready
        ledger.change(b, state="cancelled")
        account.end("failed", "it was stopped")
    assert counts(ledger.rows("test")) == {"cancelled": 2}


def test_a_disk_that_is_full_for_a_while_costs_a_video_no_attempt(
    toy: Any, ledger: BatchLedger, monkeypatch: pytest.MonkeyPatch
) -> None:
    (row,) = _submit(toy, ledger, _films(toy, "a.mp4")).to_schedule
    full = 0
    change = ledger.change

    def changed(*asked: Any, **values: Any) -> bool:
        nonlocal full
        full -= 1
        if full >= 0:
            raise StoreError("the disk is full")
        return change(*asked, **values)

    monkeypatch.setattr(ledger, "change", changed)
    monkeypatch.setattr(batches, "WAITS_S", (0.0, 0.0, 0.0))
    account = batches.Account(ledger, row)
    full = 3
    with account.kept("run") as ready:
        assert ready
        full = 3
        account.end("done", "")
        full = 3
    (ended,) = ledger.rows("test")
    assert (ended.state, ended.attempt, ended.losses) == ("done", 1, 0) and ended.seconds is not None
    full = 4
    with pytest.raises(StoreError, match="disk is full"), account.kept("run"):
        raise AssertionError("it cannot be told that it runs")


def test_two_thousand_finished_videos_are_known_within_four_seconds(toy: Any, ledger: BatchLedger) -> None:
    films = toy.folder / "films"
    films.mkdir()
    for number in range(2_000):
        (films / f"{number:05d}.mp4").write_text("x")
    rows = _submit(toy, ledger, films).to_schedule
    for row in rows:
        Path(row.run_dir).mkdir(parents=True)
        Path(row.run_dir, "run.json").touch()
    ledger.put("test", "", [replace(row, attempt=2, state="done") for row in rows])
    began = time.process_time()
    assert _submit(toy, ledger, films).finished == 2_000
    assert time.process_time() - began < 4  # 10,000 within 20 s
    renamed = batches.submit(ledger, "other", films, read_batch(films), Config(), toy.folder / "runs")
    assert (renamed.finished, renamed.to_schedule) == (2_000, ())


def test_the_report_has_a_row_a_video_with_links_and_survives_strange_names(toy: Any, ledger: BatchLedger) -> None:
    films = _films(toy, "a <b>.mp4", "c.mp4")
    toy.run()
    rows = _submit(toy, ledger, films).to_schedule
    assert toy.main("recover", "film.mp4", "--out", rows[0].run_dir)[0] == 0
    ledger.change(rows[0], state="done", seconds=1.25)
    ledger.change(rows[1], state="failed", reason="it has <no> people", stage="people · scene 0")
    page, table = write_report(toy.folder / "report", "test", ledger.rows("test"))
    text = page.read_text()
    assert "a &lt;b&gt;.mp4" in text and "it has &lt;no&gt; people" in text
    assert 'href="../runs/a__b_/view/overlay.mp4"' in text
    first, second = table.read_text().splitlines()[1:]
    assert ",done," in first and ",60,3,1,1.25," in first
    assert second.split(",")[1:4] == ["failed", "people · scene 0", "it has <no> people"]
