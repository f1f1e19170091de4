"""`humanmm batch` as a user types it; nothing is computed here (`tests/flows/service/test_batches.py` does that)."""

import csv
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from humanmm.flows.service import batches
from humanmm.storage.batches.batch_table import BatchTable, open_batches
from humanmm.storage.batches.video_row import VideoRow


@pytest.fixture
def scheduled(monkeypatch: pytest.MonkeyPatch) -> list[tuple[list[str], int | None]]:
    """Names of the videos that each call would have scheduled, and how many of them at a time."""
    calls: list[tuple[list[str], int | None]] = []

    def schedule(table: BatchTable, rows: Sequence[VideoRow], *, limit: int | None, progress: object) -> None:
        calls.append(([Path(row.video).name for row in rows], limit))

    monkeypatch.setattr(batches, "schedule", schedule)
    return calls


@pytest.fixture
def films(toy: Any) -> Any:
    """The toy, and a folder with three films of its kind."""
    (toy.folder / "films").mkdir()
    for name in "abc":
        (toy.folder / f"films/{name}.mp4").write_bytes(toy.video.read_bytes() + b" " * ord(name))
    return toy


def _end(films: Any, name: str, state: str, **more: Any) -> None:
    """What its process would have written about a video."""
    table = open_batches(films.store)
    (row,) = (row for row in table.rows("films") if Path(row.video).stem == name)
    table.change(row, state=state, **more)


@pytest.fixture
def submitted(films: Any, scheduled: list[Any]) -> Any:
    """Three films of which one is done, one partial and one has failed."""
    assert films.main("batch", "submit", "films", "--name", "films")[:2] == (0, "films\n")
    scheduled.clear()
    _end(films, "a", "done", seconds=2.0)
    _end(films, "b", "partial", stage="camera · shot 1", reason="no points")
    _end(films, "c", "failed", stage="people · scene 0", reason="nobody is in it")
    return films


def test_a_dry_run_lists_every_video_and_writes_nothing(films: Any, scheduled: list[Any]) -> None:
    status, out, message = films.main("batch", "submit", "films", "--dry-run", "--glob", "[ab].mp4")
    assert status == 0 and [Path(line.split()[0]).name for line in out.splitlines()] == ["a.mp4", "b.mp4"]
    assert "2 of 2 videos would be scheduled; nothing was written" in message
    tree = json.loads(films.main("batch", "submit", "films", "--dry-run", "--json", "--name", "mine")[1])
    assert tree["batch"] == "mine" and len(tree["videos"]) == 3
    assert scheduled == [] and not open_batches(films.store).exists


def test_what_was_submitted_is_scheduled_with_its_settings_and_the_batch_is_the_last_line(
    films: Any, scheduled: list[Any]
) -> None:
    command = ["batch", "submit", "films", "--limit", "2", "--priority", "high", "--tag", "gym", "--tag", "monday"]
    done = films.main(*command, "--hands", "--camera.static", "true", "--out", "there")
    assert done[0] == 0 and scheduled == [(["a.mp4", "b.mp4", "c.mp4"], 2)]
    (name,) = done[1].splitlines()
    rows = open_batches(films.store).rows(name)
    config = json.loads(rows[0].config)
    assert config["people"]["hands"] is True and config["camera"]["static"] is True
    assert {(row.priority, row.tags) for row in rows} == {("high", '["gym", "monday"]')}
    assert [Path(row.run_dir).relative_to(films.folder).as_posix() for row in rows] == [f"there/{n}" for n in "abc"]


@pytest.mark.parametrize(("state", "status"), [("done", 0), ("partial", 3), ("failed", 3)])
def test_with_wait_the_exit_status_says_whether_everything_was_recovered(
    films: Any, scheduled: list[Any], monkeypatch: pytest.MonkeyPatch, state: str, status: int
) -> None:
    def wait(table: BatchTable, name: str, *, limit: int | None) -> Sequence[VideoRow]:
        for video in "ac":
            _end(films, video, "done")
        _end(films, "b", state, reason="it is dark")
        return table.rows(name)

    monkeypatch.setattr(batches, "wait", wait)
    done = films.main("batch", "submit", "films", "--name", "films", "--wait")
    assert done[:2] == (status, "films\n") and len(scheduled) == 1
    assert ("it is dark" in done[2]) is (status == 3), "why, of each video that has no whole result"


def test_flags_that_exclude_each_other_are_refused(films: Any, scheduled: list[Any]) -> None:
    both = films.main("batch", "submit", "films", "--watch", "--schedule", "0 2 * * *")
    assert both[0] == 2 and "--watch and --schedule exclude each other" in both[2]
    for endless in (("--watch",), ("--schedule", "0 2 * * *")):
        refused = films.main("batch", "submit", "films", "--json", *endless)
        assert refused[0] == 2 and "--json goes with neither --watch nor --schedule" in refused[2]
    assert scheduled == []


def test_what_is_scheduled_can_be_read_by_a_program(films: Any, scheduled: list[Any]) -> None:
    tree = json.loads(films.main("batch", "submit", "films", "--name", "films", "--json")[1])
    assert (tree["batch"], tree["counts"]) == ("films", {"scheduled": 3})
    assert tree["scheduled"] == [video["video"] for video in tree["videos"]]
    _end(films, "a", "done")
    _end(films, "b", "failed", reason="no points")
    tree = json.loads(films.main("batch", "retry-failed", "--json")[1])
    assert [Path(video).name for video in tree["scheduled"]] == ["b.mp4"]
    assert tree["counts"] == {"done": 1, "scheduled": 2} and len(scheduled) == 2


def test_the_status_tells_counts_and_failures_of_the_newest_batch_or_of_that_which_is_named(submitted: Any) -> None:
    tree = json.loads(submitted.main("batch", "status", "--json")[1])
    assert (tree["batch"], tree["counts"]) == ("films", {"done": 1, "partial": 1, "failed": 1})
    assert [video["reason"] for video in tree["videos"]] == ["", "no points", "nobody is in it"]
    assert "nobody is in it" in submitted.main("batch", "status", "films")[1]
    unknown = submitted.main("batch", "status", "flims")
    assert unknown[0] != 0 and "films" in unknown[2]


def test_the_status_says_that_nobody_works_only_where_videos_wait(
    films: Any, scheduled: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    films.main("batch", "submit", "films", "--name", "films")
    assert "no worker is running: start `humanmm serve`" in films.main("batch", "status")[1]
    monkeypatch.setattr(batches, "is_served", lambda: True)
    assert "no worker" not in films.main("batch", "status")[1]
    for name in "abc":
        _end(films, name, "cancelled")
    monkeypatch.setattr(batches, "is_served", lambda: False)
    assert "no worker" not in films.main("batch", "status")[1]


def test_a_schedule_stands_in_the_status_before_its_first_time(films: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from datetime import UTC, datetime

    from humanmm.flows.server.flow_runs import Timed

    timed = [
        Timed("nightly", "0 2 * * *", "UTC", datetime(2030, 1, 2, 2, tzinfo=UTC)),
        Timed("paused", "0 3 * * *", "UTC", None),
    ]
    monkeypatch.setattr(batches, "schedules", lambda store: timed)
    assert films.main("batch", "status", "nightly")[:2] == (
        0,
        "batch nightly: nothing submitted yet\n"
        "schedule of batch nightly: '0 2 * * *' (UTC), next at 2030-01-02 02:00 UTC\n",
    )
    assert "schedule of batch paused: '0 3 * * *' (UTC), paused" in films.main("batch", "status")[1]
    assert json.loads(films.main("batch", "status", "--json")[1]) == {"batch": "nightly", "counts": {}, "videos": []}
    assert films.main("batch", "status", "other")[0] == 1


@pytest.mark.parametrize(("flags", "again"), [((), ["b.mp4", "c.mp4"]), (("--stage", "camera"), ["b.mp4"])])
def test_only_what_failed_is_tried_again(
    submitted: Any, scheduled: list[Any], flags: tuple[str, ...], again: list[str]
) -> None:
    status, out, message = submitted.main("batch", "retry-failed", *flags)
    assert (status, out) == (0, "films\n") and scheduled == [(again, None)]
    assert f"{len(again)} videos are tried again" in message


def test_failed_videos_are_tried_again_with_other_limits(submitted: Any, scheduled: list[Any]) -> None:
    assert submitted.main("batch", "retry-failed", "--run.limit_s", "60")[0] == 0
    configs = [json.loads(row.config)["run"]["limit_s"] for row in open_batches(submitted.store).rows("films")]
    assert configs == [None, 60, 60] and len(scheduled) == 1
    wrong = submitted.main("batch", "retry-failed", "--run.limit_s", "soon")
    assert wrong[0] == 2 and "run.limit_s" in wrong[2]


def test_a_report_is_written_once_and_replaced_only_when_asked(submitted: Any) -> None:
    status, out, _ = submitted.main("batch", "report", "--out", "there")
    assert status == 0 and [Path(line).name for line in out.splitlines()] == ["report.html", "report.csv"]
    rows = list(csv.DictReader((submitted.folder / "there/report.csv").read_text().splitlines()))
    assert [row["state"] for row in rows] == ["done", "partial", "failed"]
    again = submitted.main("batch", "report", "--out", "there")
    assert again[0] == 1 and "give --force to replace it" in again[2]
    assert submitted.main("batch", "report", "--out", "there", "--force")[0] == 0
    assert submitted.main("batch", "report")[0] == 0 and (submitted.folder / "batch-films/report.html").exists()


@pytest.mark.parametrize(("cron", "following"), [("0 2 * * *", "next at 2030-01-02 02:00"), ("none", "not on a sch")])
def test_a_schedule_is_set_and_ended(
    films: Any, scheduled: list[Any], monkeypatch: pytest.MonkeyPatch, cron: str, following: str
) -> None:
    from datetime import UTC, datetime

    asked: list[Any] = []

    def set_schedule(request: Any, store: str, cron: str | None, *, limit: int | None) -> datetime | None:
        asked.append((request.batch, store, cron, limit))
        return datetime(2030, 1, 2, 2, tzinfo=UTC) if cron else None

    monkeypatch.setattr(batches, "set_schedule", set_schedule)
    done = films.main("batch", "submit", "films", "--name", "nightly", "--schedule", cron, "--limit", "3")
    assert done[:2] == (0, "nightly\n") and following in done[2]
    assert asked == [("nightly", str(films.store), None if cron == "none" else cron, 3)] and scheduled == []


def test_a_watched_folder_is_reported_until_ctrl_c(films: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def watch(request: Any, table: BatchTable, *, limit: int | None) -> Any:
        yield request.submit(table, request.videos())
        raise KeyboardInterrupt

    monkeypatch.setattr(batches, "watch", watch)
    status, out, message = films.main("batch", "submit", "films", "--name", "inbox", "--watch")
    assert (status, out) == (0, "")
    assert "batch inbox: watching films" in message and "3 to do" in message
