"""`humanmm serve`: the local Prefect server, our deployments, and a worker that runs each video in its own process.

One per user (a lock says so). Every few seconds it checks its processes: it starts a server that has
died again at its old address, a worker likewise, and it ends flow runs whose process is lost as `Crashed`, so that
nothing stays `Running` for ever.
"""

import asyncio
import contextlib
import fcntl
import logging
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast
from uuid import UUID

import httpx

from humanmm.errors import HumanMMError, InputError, StoreError
from humanmm.flows.server.known_stores import known_stores
from humanmm.flows.server.local_server import (
    ServerFiles,
    check_settings,
    ensure_server,
    prefect_server,
    server_files,
    start_alone,
    stop_unused_server,
)
from humanmm.flows.service.lost_runs import crash_lost_runs, resume_lost_videos
from humanmm.flows.service.video_processes import MARK, videos_of
from humanmm.flows.service.worker import VIDEOS_LIMIT_S, stop_videos
from humanmm.machine import num_processors
from humanmm.signals import STOP_SIGNALS
from humanmm.storage.batches.batch_table import open_batches
from humanmm.tasks.units.faults import in_words, is_infrastructure_fault

if TYPE_CHECKING:
    from prefect.client.orchestration import SyncPrefectClient

log = logging.getLogger(__name__)

LOOK_EVERY_S = 10.0
ROOM_BYTES = 32 << 20
START_LIMIT_S = 240.0
READY = "serving"
"""A file that exists while `humanmm serve` runs flow runs."""
WORKER_LIMIT_S = 15.0
"""How long the worker may take to stop, once its videos have, before it is killed: longer than its own limit."""
SUBMISSIONS = "submit"
QUEUES = (SUBMISSIONS, "high", "default", "low")
"""Queues of the work pool, the most urgent first: submitting a batch takes seconds, and waits for one video at most."""


def is_serving(files: ServerFiles) -> bool:
    """Whether a `humanmm serve` of this user is up, ready or about to be."""
    with (files.home / "serving.lock").open("a+") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        return False


def bring_up(*, limit: int | None, idle_s: float) -> None:
    """Start `humanmm serve` in the background unless one runs, and wait until it runs flow runs."""
    if has_workers_elsewhere():
        return
    files = server_files()
    deadline = time.monotonic() + START_LIMIT_S
    started = False
    while not (is_serving(files) and (files.home / READY).exists()):
        if not started and not is_serving(files):
            started = True
            check_settings()  # else nothing would say why it is never ready
            log.info("starting humanmm serve in the background")
            command = [sys.executable, "-m", "humanmm.flows.service.serve", str(limit or default_limit()), str(idle_s)]
            start_alone(command, files.home / "serve.log", Path.cwd())
            time.sleep(0.5)
        if time.monotonic() > deadline:
            raise StoreError(f"humanmm serve could not be started; {files.home / 'serve.log'} says why")
        time.sleep(0.1)


def has_workers_elsewhere() -> bool:
    """Whether the user's own server ($PREFECT_API_URL) has a worker for us already, on this machine or another."""
    if not os.environ.get("PREFECT_API_URL"):
        return False
    from prefect import get_client

    from humanmm.flows.server.flow_runs import POOL

    with get_client(sync_client=True) as client:
        pools = [pool.name for pool in client.read_work_pools()]
        workers = client.read_workers_for_work_pool(POOL) if POOL in pools else []
        return any(worker.status == "ONLINE" for worker in workers)


def default_limit() -> int:
    """Videos at the same time: each may run two stages at once."""
    return max(1, num_processors() // 2)


def serve(*, limit: int, idle_s: float | None = None, on_ready: Any = None) -> None:
    """Serve until one of STOP_SIGNALS, or until there was nothing to do for `idle_s` seconds.

    `on_ready` is called with the dashboard's address when flow runs can be scheduled.
    """
    files = server_files()
    leave = threading.Event()
    with _signals(leave), _only_one(files):
        while _has_room(files, leave):
            try:
                _serve_until_told(files, leave, limit, idle_s, on_ready)
                break
            except (OSError, httpx.TransportError) as error:  # the disk has filled up, the server has died
                if isinstance(error, OSError) and not is_infrastructure_fault(error):
                    raise
                log.warning("%s: humanmm serve starts again", in_words(error))
                if leave.wait(LOOK_EVERY_S):
                    break
        stop_unused_server(files)


def _serve_until_told(
    files: ServerFiles, leave: threading.Event, limit: int, idle_s: float | None, on_ready: Any
) -> None:
    with prefect_server(is_wanted=lambda: not leave.is_set()) as url:
        if not url or leave.is_set():
            return
        asyncio.run(_deploy(limit, Path.cwd()))
        worker = Worker(files, limit)
        try:
            worker.start()
            (files.home / READY).write_text(url)
            if on_ready is not None:
                with contextlib.suppress(OSError):  # standard output may be closed: the service goes on
                    on_ready(url.removesuffix("/api"))
            _look_after(files, worker, leave, idle_s)
        finally:
            (files.home / READY).unlink(missing_ok=True)
            worker.stop()
            with contextlib.suppress(Exception):  # the server may be the one that is gone
                _crash_all()


def _has_room(files: ServerFiles, leave: threading.Event) -> bool:
    """Wait until the disk has room for a server's files; False if it received a signal to end before."""
    while (free := shutil.disk_usage(files.home).free) < ROOM_BYTES:
        log.warning(
            "%d MB are free on the disk of %s; the server starts when it has %d",
            free >> 20,
            files.home,
            ROOM_BYTES >> 20,
        )
        if leave.wait(LOOK_EVERY_S):
            return False
    return True


def _crash_all() -> None:
    from prefect import get_client

    with get_client(sync_client=True) as client:
        crash_lost_runs(client, is_starting=False)


class Worker:
    """Prefect's process worker in a process of its own, and the videos of those that have died."""

    def __init__(self, files: ServerFiles, limit: int) -> None:
        self._log, self._limit = files.home / "worker.log", limit
        self._process: subprocess.Popen[bytes] | None = None
        self._mark = uuid.uuid4().hex

    def start(self) -> None:
        from humanmm.flows.server.flow_runs import POOL

        name = f"{os.uname().nodename}-{os.getpid()}"
        command = [sys.executable, "-m", "humanmm.flows.service.worker", POOL, str(self._limit), name]
        with self._log.open("ab") as output:
            self._process = subprocess.Popen(
                command, env={**os.environ, MARK: self._mark},
                stdin=subprocess.PIPE, stdout=output, stderr=output, start_new_session=True,
            )  # fmt: skip

    def keep_up(self) -> None:
        """Start it again if it has died. Its videos go on without it."""
        if self._process is not None and self._process.poll() is not None:
            log.warning("the worker has ended (%s); it is started again", self._process.returncode)
            self._close()
            self.start()

    @property
    def has_videos(self) -> bool:
        """Whether it computes any."""
        return bool(videos_of(self._mark))

    def stop(self) -> None:
        """End the worker and all videos."""
        if self._process is None:
            return
        self._close()  # at the end of its input it stops its videos and itself
        try:
            self._process.wait(VIDEOS_LIMIT_S + WORKER_LIMIT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        stop_videos(self._mark)

    def _close(self) -> None:
        if self._process is not None and self._process.stdin is not None:
            self._process.stdin.close()


async def _deploy(limit: int, folder: Path) -> None:
    """The work pool with a queue per priority, and the three deployments. Done again, nothing changes."""
    from prefect import get_client
    from prefect.client.schemas.actions import WorkPoolCreate, WorkPoolUpdate
    from prefect.exceptions import ObjectAlreadyExists
    from prefect.types.entrypoint import EntrypointType
    from prefect.workers.process import ProcessWorker

    from humanmm.flows.batch import recover_batch, recover_video
    from humanmm.flows.gpu import declare_gpus
    from humanmm.flows.maintain import maintain
    from humanmm.flows.server.flow_runs import POOL

    async with get_client() as client:
        template = ProcessWorker.get_default_base_job_template()
        with contextlib.suppress(ObjectAlreadyExists):
            await client.create_work_pool(WorkPoolCreate(name=POOL, type="process", base_job_template=template))
        await client.update_work_pool(POOL, WorkPoolUpdate(concurrency_limit=limit, base_job_template=template))
        await declare_gpus(client)
        # The most urgent first: a queue that gets a priority moves only those with the same or a less urgent one.
        for priority, queue in enumerate(QUEUES, start=1):
            with contextlib.suppress(ObjectAlreadyExists):
                await client.create_work_queue(name=queue, work_pool_name=POOL, priority=priority)
            found = await client.read_work_queue_by_name(queue, work_pool_name=POOL)
            if found.priority != priority:
                await client.update_work_queue(found.id, priority=priority)
        for target in (recover_video, recover_batch, maintain):
            deployment: Any = await cast(Any, target).ato_deployment(
                name=target.name,
                work_pool_name=POOL,
                work_queue_name=SUBMISSIONS if target is recover_batch else None,
                entrypoint_type=EntrypointType.MODULE_PATH,
                # the server takes nearly twice as long for a flow run whose parameters it checks; the flow does
                enforce_parameter_schema=target is not recover_video,
                job_variables={
                    "command": f"{sys.executable} -m prefect.engine",  # which our worker runs in a fork
                    "working_dir": str(folder),
                    "stream_output": True,
                },
            )
            await deployment.aapply() if hasattr(deployment, "aapply") else await deployment.apply()


def _look_after(files: ServerFiles, worker: Worker, leave: threading.Event, idle_s: float | None) -> None:
    from prefect import get_client

    last_busy = time.monotonic()
    with get_client(sync_client=True) as client:  # to open one takes longer than all requests of a look
        tables, settled = BatchTables(client), set[UUID]()
        while not leave.wait(LOOK_EVERY_S):
            worker.keep_up()
            waiting = worker.has_videos  # which go on when a look is cut short
            if not os.environ.get("PREFECT_API_URL") or not ensure_server(files):
                log.warning("the Prefect server is gone and cannot be started; %s says why", files.log)
            else:
                try:
                    waiting |= bool(resume_lost_videos(files)) | crash_lost_runs(client, settled)
                    tables.update(files)
                except Exception as error:  # the server may be busy or restarting, the disk full: the next look retries
                    log.warning("a look after lost videos was cut short: %s", error)
            if waiting:
                last_busy = time.monotonic()
            elif idle_s is not None and time.monotonic() - last_busy > idle_s:
                return


class BatchTables:
    """Keeps the tables of batches on the dashboard up to date."""

    def __init__(self, client: "SyncPrefectClient") -> None:
        self._client = client
        self._shown: dict[tuple[str, str], float] = {}

    def update(self, files: ServerFiles) -> None:
        """Show the batches that have changed since they were shown last."""
        from humanmm.flows.server.dashboard import show_batch

        for place in known_stores(files):
            try:
                table = open_batches(place)
                for name, changed in table.last_changes().items():
                    if self._shown.get((place, name)) != changed:
                        show_batch(self._client, name, table.rows(name))
                        self._shown[place, name] = changed
            except HumanMMError as error:  # the next look will do; other stores do not wait for it
                log.info("the batches of a store could not be read: %s", error)


@contextlib.contextmanager
def _only_one(files: ServerFiles) -> Iterator[None]:
    with (files.home / "serving.lock").open("a+") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError("humanmm serve runs already; one is enough, `humanmm doctor` shows its address") from None
        (files.home / READY).unlink(missing_ok=True)  # left by one that was killed
        yield


@contextlib.contextmanager
def _signals(leave: threading.Event) -> Iterator[None]:
    before = {number: signal.signal(number, lambda *_: leave.set()) for number in STOP_SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


if __name__ == "__main__":
    serve(limit=int(sys.argv[1]), idle_s=float(sys.argv[2]))
