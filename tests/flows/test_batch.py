"""The flows of batches: what is written of a video in the table, however its flow ends."""

import json
from pathlib import Path
from typing import Any

import pytest

from humanmm.config import Config
from humanmm.flows.server.local_server import prefect_server
from humanmm.storage.batches.batch_table import BatchTable, open_batches
from humanmm.storage.batches.video_row import VideoRow
from humanmm.tasks.batches.request import BatchRequest

pytestmark = pytest.mark.usefixtures("server_cache")


@pytest.fixture
def table(toy: Any) -> BatchTable:
    return open_batches(toy.store)


def _submitted(toy: Any, table: BatchTable) -> VideoRow:
    """The toy's film as a batch."""
    request = BatchRequest(source=toy.folder, out=toy.folder / "runs", config=Config(), name="b", pattern="film.mp4")
    (row,) = request.submit(table, request.videos()).to_schedule
    return row


def _run(toy: Any, row: VideoRow, *, attempt: int | None = None) -> Any:
    """The final state of the flow run of one attempt at a video."""
    given = {"batch": row.batch, "attempt": row.attempt if attempt is None else attempt}
    with prefect_server():
        from humanmm.flows.batch import recover_video  # only now: Prefect reads its settings on import

        return recover_video(Path(row.video), Path(row.run_dir), store=toy.store, **given, return_state=True)


@pytest.mark.parametrize(
    ("fault", "flow", "ended", "reason"),
    [
        ("", "Completed", "done", ""),
        ("camera:20=stage", "Partial", "partial", "camera · shot 1: camera:20 cannot be done"),
        ("align=stage", "Failed", "failed", "align cannot be done"),
    ],
)
def test_the_table_says_how_a_video_ended(
    toy: Any, table: BatchTable, monkeypatch: pytest.MonkeyPatch, fault: str, flow: str, ended: str, reason: str
) -> None:
    monkeypatch.setenv("TOY_FAIL", fault)
    row = _submitted(toy, table)
    assert _run(toy, row).name == flow
    (now,) = table.rows("b")
    assert (now.state, now.reason) == (ended, reason) and now.seconds is not None and not now.is_owned
    assert Path(row.run_dir, "run.json").exists() is (ended != "failed")
    if ended != "failed":
        assert json.loads(Path(row.run_dir, "run.json").read_text())["state"] == ended
        assert "align" in Path(row.run_dir, "run.log").read_text()


def test_an_attempt_that_is_not_wanted_any_more_computes_nothing(toy: Any, table: BatchTable) -> None:
    row = _submitted(toy, table)
    assert "no longer wants attempt 2" in _run(toy, row, attempt=2).message
    table.change(row, state="cancelled")
    assert _run(toy, row).name == "Cancelled"
    assert toy.executed() == [] and [one.state for one in table.rows("b")] == ["cancelled"]
