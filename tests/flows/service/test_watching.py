"""When a watched folder is submitted again, and by which clock a schedule goes; without a server."""

from pathlib import Path
from typing import Any

import pytest

from humanmm.config import Config
from humanmm.errors import InputError
from humanmm.flows.service import batches
from humanmm.storage.batches.batch_table import open_batches
from humanmm.storage.batches.owner import Owner
from humanmm.tasks.batches.request import BatchRequest


def test_a_video_that_changes_while_it_runs_is_submitted_when_that_has_ended(
    toy: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    films = Path(toy.folder / "films")
    films.mkdir()
    (films / "a.mp4").write_text('{"num_frames": 60, "cuts": [20]}')
    table = open_batches(toy.store)
    request = BatchRequest(source=films, out=toy.folder / "runs", config=Config(), name="inbox", settle_s=0.0)
    looks: list[float] = []

    def sleep(seconds: float) -> None:
        looks.append(seconds)
        assert len(looks) < 20
        if len(looks) == 5:
            (row,) = table.rows("inbox", "running")
            assert table.change(row, state="done", owner="")

    monkeypatch.setattr(batches, "schedule", lambda *_, **__: None)
    monkeypatch.setattr("time.sleep", sleep)
    watched = batches.watch(request, table, limit=None)
    (row,) = next(watched).to_schedule
    assert table.change(row, state="running", owner=str(Owner.this_process()))
    (films / "a.mp4").write_text('{"num_frames": 90, "cuts": [20]}')
    (films / "b.mp4").write_text('{"num_frames": 61, "cuts": [20]}')
    second = next(watched)
    assert [Path(one.video).name for one in second.to_schedule] == ["b.mp4"] and second.outdated == (row.video,)
    third = next(watched)
    assert len(looks) >= 5, "it waits until the first has ended"
    assert [(one.video, one.attempt) for one in third.to_schedule if one.video == row.video] == [(row.video, 2)]


@pytest.mark.parametrize("named", ["Europe/Berlin", ":Europe/Berlin", "/usr/share/zoneinfo/Europe/Berlin"])
def test_a_schedule_goes_by_the_machines_clock(named: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", named)
    assert batches._timezone() == "Europe/Berlin"


@pytest.mark.parametrize("named", ["CET-1CEST", "Nowhere/At_all", "../../etc/passwd"])
def test_a_clock_without_a_name_is_told(
    named: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("TZ", named)
    assert batches._timezone() == "UTC"
    assert "the schedule's times are UTC" in caplog.text


def test_a_machine_without_a_clock_of_its_own_goes_by_utc(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.delenv("TZ", raising=False)
    monkeypatch.setattr(batches, "LOCALTIME", tmp_path / "localtime")
    assert batches._timezone() == "UTC" and caplog.text == ""
    (tmp_path / "localtime").symlink_to("/usr/share/zoneinfo/Asia/Tokyo")
    assert batches._timezone() == "Asia/Tokyo"


def test_a_schedule_of_a_source_that_is_not_there_is_refused_before_anything_starts(
    toy: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def bring_up(**how: Any) -> None:
        raise AssertionError("a service was started")

    monkeypatch.setattr(batches, "bring_up", bring_up)
    request = BatchRequest(source=toy.folder / "typo", out=toy.folder / "runs", config=Config())
    with pytest.raises(InputError, match=r"cannot read .*typo: No such file or directory; give a folder"):
        batches.set_schedule(request, str(toy.store), "0 2 * * *", limit=None)
