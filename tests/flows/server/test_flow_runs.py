"""Rows of the batch table as flow runs of Prefect."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import httpx
import pytest
from prefect.exceptions import PrefectHTTPStatusError

from humanmm.errors import InputError
from humanmm.flows.server import flow_runs
from humanmm.storage.batches.batch_table import open_batches
from humanmm.storage.batches.video_row import VideoRow


class _BusyServer:
    """A client of a server that takes only some videos."""

    def __init__(self, taken: set[str]) -> None:
        self._taken = taken
        self.asked: list[str] = []
        self.keys: list[str] = []

    def __enter__(self) -> "_BusyServer":
        return self

    def __exit__(self, *error: object) -> None:
        pass

    def read_deployment_by_name(self, name: str) -> Any:
        return SimpleNamespace(id=name)

    def create_flow_run_from_deployment(self, deployment: str, *, name: str, idempotency_key: str, **asked: Any) -> Any:
        self.asked.append(name)
        self.keys.append(idempotency_key)
        if name in self._taken:
            return SimpleNamespace(id=f"run of {name}")
        request = httpx.Request("POST", "http://127.0.0.1/api")
        raise PrefectHTTPStatusError("503", request=request, response=httpx.Response(503, request=request))


def test_late_submissions_of_the_same_batch_are_cancelled(monkeypatch: pytest.MonkeyPatch) -> None:
    server = _BusyServer(set())
    late = [SimpleNamespace(id=number, parameters={"name": name}) for number, name in enumerate(("a", "b", "a", None))]
    asked: list[Any] = []
    ended: list[tuple[int, str]] = []
    monkeypatch.setattr(server, "read_flow_runs", lambda **filters: asked.append(filters) or late, raising=False)
    monkeypatch.setattr(
        server, "set_flow_run_state", lambda run, state: ended.append((run, state.type.value)), raising=False
    )
    monkeypatch.setattr(flow_runs, "get_client", lambda **kind: server)
    flow_runs.cancel_late("a")
    assert ended == [(0, "CANCELLED"), (2, "CANCELLED")]
    assert asked[0]["flow_run_filter"].next_scheduled_start_time.before_ is not None
    assert asked[0]["flow_filter"].name.any_ == ["recover-batch"]


def test_videos_that_a_busy_server_does_not_take_wait_in_the_table(
    toy: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HUMANMM_CACHE", str(tmp_path / "cache"))
    table = open_batches(toy.store)
    rows = [VideoRow("b", f"{name}.mp4", 0, f"/runs/{name}", "{}", "normal", "[]", "", "") for name in "ab"]
    table.put(rows)
    server = _BusyServer({"a.mp4"})
    monkeypatch.setattr(flow_runs, "get_client", lambda **kind: server)
    told: list[tuple[int, int]] = []
    flow_runs.schedule(table, rows, progress=lambda done, total: told.append((done, total)))
    assert told == [(number, len(rows)) for number in range(len(rows))]
    assert [row.video for row in table.unscheduled()] == ["b.mp4"], "`humanmm serve` schedules it at its next look"
    server = _BusyServer({"a.mp4", "b.mp4"})
    monkeypatch.setattr(flow_runs, "get_client", lambda **kind: server)
    flow_runs.schedule(table, rows)
    assert server.asked == ["b.mp4"], "nobody asks for what somebody has asked for meanwhile"


def test_a_batch_that_is_new_again_does_not_get_the_flow_runs_of_its_former_life(
    toy: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HUMANMM_CACHE", str(tmp_path / "cache"))
    server = _BusyServer({"a.mp4"})
    monkeypatch.setattr(flow_runs, "get_client", lambda **kind: server)
    table = open_batches(toy.store)
    row = VideoRow("b", "a.mp4", 0, "/runs/a", "{}", "normal", "[]", "", "")
    for _ in range(2):
        standing = table.put([row])
        flow_runs.schedule(table, standing)
        table.change(standing[0], flow_run=None)
        flow_runs.schedule(table, standing)  # by somebody who does not know that it was created
        assert table.path is not None
        table.path.unlink()
    first, again, second, _ = server.keys
    assert first == again != second


@pytest.mark.parametrize(
    ("cron", "message"),
    [("at night", "is no cron line such as"), ("0 0 30 2 *", "never comes: no year has such a day")],
)
def test_a_schedule_that_never_comes_is_refused_before_the_one_that_there_is_is_touched(
    monkeypatch: pytest.MonkeyPatch, cron: str, message: str
) -> None:
    monkeypatch.setattr(flow_runs, "get_client", lambda: pytest.fail("nothing was to be changed"))
    with pytest.raises(InputError, match=message):
        flow_runs.set_schedule("nightly", cron, "UTC", {})
