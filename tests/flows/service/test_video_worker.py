"""A worker without room for a video leaves the server alone, but for a sign of life; with room it asks each time."""

import asyncio
import functools
import gc
import multiprocessing
import os
import signal
import time
import weakref
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import anyio
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


def test_what_a_video_leaves_in_circles_does_not_stay_until_python_looks(monkeypatch: pytest.MonkeyPatch) -> None:
    process = multiprocessing.get_context("spawn").Process(target=time.sleep, args=(0.0,))
    monkeypatch.setattr(video_worker.fork_server, "start", lambda *_: process.start() or process)
    left: Any = type("Left", (), {})()
    left.itself, still_there = left, weakref.ref(left)
    status = SimpleNamespace(started=lambda handle: None)
    gc.disable()
    try:
        del left
        asyncio.run(
            video_worker.run_in_fork(task_status=status, task_status_handler=lambda p: p, env={}, cwd=None)  # type: ignore[arg-type]
        )
        assert still_there() is None
    finally:
        gc.enable()


@pytest.mark.parametrize("cancelled", [False, True])
def test_its_process_gets_what_differs_and_ends_with_its_flow_run(
    cancelled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("KEPT", "same")
    monkeypatch.setenv("GONE", "1")
    sent: list[dict[str, str | None]] = []
    # a fork of a test process that has run hundreds of tests inherits whatever they left
    process = multiprocessing.get_context("spawn").Process(target=time.sleep, args=(60.0 if cancelled else 0.0,))

    def start(changes: dict[str, str | None], folder: Path) -> Any:
        sent.append(changes)
        process.start()
        return process

    async def run() -> None:
        async with anyio.create_task_group() as tasks:
            environment = {name: value for name, value in os.environ.items() if name != "GONE"}
            handle = functools.partial(
                video_worker.run_in_fork, env={**environment, "NEW": "1"}, cwd=None, task_status_handler=lambda p: p
            )
            assert await tasks.start(functools.partial(_run, handle)) is process
            if cancelled:
                tasks.cancel_scope.cancel()

    async def _run(handle: Any, *, task_status: Any) -> None:
        await handle(task_status=task_status)

    monkeypatch.setattr(video_worker.fork_server, "start", start)
    asyncio.run(run())
    process.join(10)
    assert process.exitcode == (-signal.SIGTERM if cancelled else 0)
    assert sent == [{"NEW": "1", "GONE": None}]


def test_it_works_for_pools_of_prefects_own_process_worker() -> None:
    assert video_worker.VideoWorker.type == "process"
