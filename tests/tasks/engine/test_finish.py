"""The run folder at the end of a run: written by one run at a time."""

import errno
import logging
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from humanmm.errors import InputError, StoreError
from humanmm.storage.run_folder.motion_zarr import read_motion
from humanmm.storage.run_folder.run_record import read_run_record
from humanmm.storage.store import maintenance
from humanmm.storage.store.locks import FileLock
from humanmm.tasks.engine import finish


def test_runs_into_one_folder_at_once_write_it_one_after_the_other(toy: Any) -> None:
    toy.run()
    runs = [toy.run() for _ in range(4)]
    folder = toy.folder / "out"

    def write(run: Any) -> str:
        return finish.write_results(run, folder, started=time.time(), log_text="written\n")

    with ThreadPoolExecutor(len(runs)) as threads:
        assert list(threads.map(write, runs)) == ["done"] * len(runs)
    assert read_motion(folder / "motion.zarr").num_frames == 60
    assert (folder / "run.log").read_text() == "written\n" * len(runs), "no run loses the log of another"
    assert not list(folder.rglob(".writing-*"))


def test_a_run_whose_folder_is_being_written_waits_and_says_so(toy: Any, caplog: pytest.LogCaptureFixture) -> None:
    run, folder = toy.run(), Path(toy.folder / "out")
    caplog.set_level(logging.WARNING, "humanmm")
    with FileLock(folder / finish.LOCK, waiting="").held():
        writing = threading.Thread(target=finish.write_results, args=(run, folder), kwargs={"started": time.time()})
        writing.start()
        deadline = time.monotonic() + 60
        while "another run is writing" not in caplog.text and time.monotonic() < deadline:
            time.sleep(0.01)
        assert not (folder / "run.json").exists()
    writing.join()
    assert (folder / "run.json").exists()
    assert f"another run is writing {folder}; waiting for it" in caplog.text


def test_who_reads_a_folder_while_it_is_written_waits_for_its_end(toy: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two runs of one video at once the first read its summary while the second wrote."""
    run, folder = toy.run(), Path(toy.folder / "out")
    finish.write_results(run, folder, started=time.time())
    begun, write = threading.Event(), finish.write_run_record

    def slowly(*given: Any) -> None:
        begun.set()
        time.sleep(0.5)
        write(*given)

    monkeypatch.setattr(finish, "write_run_record", slowly)
    writing = threading.Thread(target=finish.write_results, args=(run, folder), kwargs={"started": time.time()})
    writing.start()
    assert begun.wait(60)
    assert read_run_record(folder)["state"] == "done"
    writing.join()


def test_a_folder_whose_writing_breaks_off_is_not_read_with_its_old_record(
    toy: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The new motion lay beside the run.json of the old one: its settings, warnings and focal length."""
    run = toy.run()
    assert finish.write_results(run, toy.folder / "out", started=time.time()) == "done"

    def fail(*given: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(finish, "write_run_record", fail)
        with pytest.raises(StoreError, match="the disk is full; free some space or name another folder with --out"):
            finish.write_results(run, toy.folder / "out", started=time.time())
    with pytest.raises(InputError, match=r"is being written, or its writing broke off; `humanmm recover` writes it"):
        read_run_record(toy.folder / "out")
    assert not finish.is_up_to_date(run, toy.folder / "out")
    finish.write_results(run, toy.folder / "out", started=time.time())
    assert read_run_record(toy.folder / "out")["state"] == "done" and finish.is_up_to_date(run, toy.folder / "out")


def test_what_was_written_by_other_code_is_not_finished_by_its_recipe(
    toy: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exports of an earlier version stayed in the run folders of a batch that was submitted again."""
    run = toy.run()
    before = finish.code_of(run.stages, run.keys.code)
    assert finish.code_of(run.stages, run.keys.code) == before
    monkeypatch.setattr(finish, "_writer_digest", lambda: "of other code")
    assert finish.code_of(run.stages, run.keys.code) != before


def test_a_run_that_failed_leaves_gc_nothing_of_the_run_folder_that_stands(
    toy: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = toy.run()
    finish.write_results(run, toy.folder / "out", started=time.time())
    monkeypatch.setenv("TOY_FAIL", "scenes=bug")
    for name in ("first", "second"):  # the run before the second is one that failed
        toy.edit("scenes", "def scenes(", f"{name} = 0\n\n\ndef scenes(")
        failed = toy.run(expect_failure=True)
        finish.remember(failed, "failed", run_dir=None, reason="a defect")
    assert [one.reason for one in maintenance.removable(run.store, unused_days=-1)] == []
    assert maintenance.removable(run.store, unused_days=-1, with_runs=True)
    monkeypatch.delenv("TOY_FAIL")
    finish.write_results(toy.run(), toy.folder / "out", started=time.time())
    assert maintenance.removable(run.store, unused_days=-1), "of the run folder before nothing is kept any more"
