"""A worker without room for a video leaves the server alone, but for a sign of life; with room it asks each time."""

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest
from prefect.workers.process import ProcessWorker

from humanmm.flows.service import video_worker


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """When Prefect's own worker asked the server for flow runs, by the clock that the worker reads."""
    times: list[float] = []

    async def ask(self: ProcessWorker) -> list[Any]:
        times.append(video_worker.time.monotonic())
        return []

    monkeypatch.setattr(ProcessWorker, "get_and_submit_flow_runs", ask)
    return times


def look(worker: video_worker.VideoWorker, monkeypatch: pytest.MonkeyPatch, *, at: float, room: int) -> None:
    monkeypatch.setattr(video_worker, "time", SimpleNamespace(monotonic=lambda: at))
    worker._limiter = SimpleNamespace(available_tokens=room)  # type: ignore[assignment]
    asyncio.run(worker.get_and_submit_flow_runs())


def test_it_asks_while_it_has_room_and_now_and_then_when_it_has_none(
    asked: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    worker = video_worker.VideoWorker(work_pool_name="humanmm", limit=2)
    for at, room in ((100.0, 2), (102.0, 1), (104.0, 0), (130.0, 0), (133.0, 0), (135.0, 0), (137.0, 1)):
        look(worker, monkeypatch, at=at, room=room)
    assert asked == [100.0, 102.0, 133.0, 137.0]


def test_it_works_for_pools_of_prefects_own_process_worker() -> None:
    assert video_worker.VideoWorker.type == "process"
