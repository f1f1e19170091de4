"""Rows of the batch table as flow runs of Prefect: created, created again at the times of a schedule, ended."""

import asyncio
import json
import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any
from uuid import UUID

import httpx
from prefect import get_client
from prefect.client.schemas.actions import DeploymentScheduleCreate
from prefect.client.schemas.filters import (
    FlowFilter,
    FlowFilterName,
    FlowRunFilter,
    FlowRunFilterNextScheduledStartTime,
    FlowRunFilterState,
    FlowRunFilterStateType,
)
from prefect.client.schemas.objects import StateType
from prefect.client.schemas.schedules import CronSchedule
from prefect.exceptions import ObjectNotFound
from prefect.states import Cancelled, Scheduled

from humanmm.errors import InputError
from humanmm.flows.server.known_stores import note_store
from humanmm.flows.server.local_server import server_files
from humanmm.storage.batches.batch_table import BatchTable
from humanmm.storage.batches.video_row import VideoRow
from humanmm.tasks.units.faults import in_words

log = logging.getLogger(__name__)

POOL = "humanmm"
DEPLOYMENT = "recover-video/recover-video"
BATCH_DEPLOYMENT = "recover-batch/recover-batch"


def schedule(
    table: BatchTable, rows: Sequence[VideoRow], *, progress: Callable[[int, int], None] = lambda done, total: None
) -> None:
    """Create a flow run per video, unless Prefect has one of the same batch, video and attempt.

    When the row was scheduled is part of that: a batch whose table was deleted counts its attempts from 1 again. A
    video whose process was lost waits a little, the longer the more often it was lost. Rows that a busy server refuses
    stay without a flow run, and `humanmm serve` sends them again at its next look. `progress` is called with the videos
    done and all videos.
    """
    note_store(server_files(), table.store.location)
    refused: list[str] = []
    with get_client(sync_client=True) as client:
        deployment = client.read_deployment_by_name(DEPLOYMENT)
        for number, row in enumerate(rows):
            progress(number, len(rows))
            if not _is_unscheduled(row, table):
                continue
            try:
                made = client.create_flow_run_from_deployment(
                    deployment.id,
                    parameters=_parameters(row, table),
                    name=Path(row.video).name[:100],
                    tags=[f"batch:{row.batch}", *json.loads(row.tags)],
                    idempotency_key=f"{table.store.location}:{row.key}:{row.attempt}:{row.changed}",
                    work_queue_name=queue_of(row.priority),
                    state=Scheduled(scheduled_time=datetime.now(UTC) + timedelta(seconds=_pause_s(row))),
                )
            except httpx.HTTPError as error:
                refused.append(in_words(error))
            else:
                table.change(row, only_from=("scheduled",), flow_run=str(made.id))
    if refused:
        log.warning("%d videos wait until the Prefect server responds again (%s)", len(refused), refused[0])


def _is_unscheduled(row: VideoRow, table: BatchTable) -> bool:
    """Whether nobody has scheduled it meanwhile: `humanmm serve` and `batch submit` read the same rows."""
    now = table.row(row.batch, row.video)
    return now is not None and (now.attempt, now.flow_run) == (row.attempt, row.flow_run)


def set_schedule(name: str, cron: str | None, timezone: str, parameters: Mapping[str, Any]) -> datetime | None:
    """Have `recover_batch` run at the times of a cron line, in place of what `name` had before; None ends it.

    Returns when it is next. InputError, and nothing is changed, for a line that is none or whose time never comes.
    """
    from prefect.server.schemas import schedules as server_schedules  # slow to import, and seldom needed

    schedule = None
    if cron is not None:
        try:
            schedule = CronSchedule(cron=cron, timezone=timezone)
        except ValueError:
            raise InputError(f"--schedule {cron!r} is no cron line such as '0 2 * * *' (in {timezone})") from None

    async def next_date(cron: str) -> datetime:
        try:
            return (await server_schedules.CronSchedule(cron=cron, timezone=timezone).get_dates(1))[0]
        except ValueError:
            raise InputError(f"--schedule {cron!r} never comes: no year has such a day") from None

    async def set_it() -> datetime | None:
        following = None if cron is None else await next_date(cron)
        async with get_client() as client:
            deployment = await client.read_deployment_by_name(BATCH_DEPLOYMENT)
            for old in deployment.schedules:
                if old.slug == name:
                    await client.delete_deployment_schedule(deployment.id, old.id)
            if schedule is not None:
                timed = DeploymentScheduleCreate(schedule=schedule, parameters={**parameters, "name": name}, slug=name)
                await client.create_deployment_schedules(deployment.id, [timed])
        return following

    return asyncio.run(set_it())


@dataclass(frozen=True)
class Timed:
    """A batch that is submitted at the times of a cron line."""

    batch: str
    cron: str
    timezone: str
    following: datetime | None
    """When it is next; None while it is paused on the dashboard."""

    @property
    def sentence(self) -> str:
        following = f"next at {self.following:%Y-%m-%d %H:%M %Z}" if self.following else "paused"
        return f"schedule of batch {self.batch}: '{self.cron}' ({self.timezone}), {following}"


def schedules(store: str) -> list[Timed]:
    """The schedules of a store's batches."""
    with get_client(sync_client=True) as client:
        try:
            found = client.read_deployment_by_name(BATCH_DEPLOYMENT).schedules
        except ObjectNotFound:
            return []
    ours = [one for one in found if isinstance(one.schedule, CronSchedule) and one.parameters.get("store") == store]
    return [_timed(str(one.slug), one.schedule, is_active=one.active) for one in ours]


def _timed(batch: str, schedule: Any, *, is_active: bool) -> Timed:
    from prefect.server.schemas import schedules as server_schedules  # slow to import, and seldom needed

    times = server_schedules.CronSchedule(cron=schedule.cron, timezone=schedule.timezone)
    following = asyncio.run(times.get_dates(1))[0] if is_active else None
    return Timed(batch, schedule.cron, schedule.timezone or "UTC", following)


def cancel_late(batch: str) -> None:
    """Cancel the submissions of a batch whose time has passed: the one that runs now does what they would do."""
    now: Any = datetime.now(UTC)
    late = FlowRunFilter(
        state=FlowRunFilterState(type=FlowRunFilterStateType(any_=[StateType.SCHEDULED])),
        next_scheduled_start_time=FlowRunFilterNextScheduledStartTime(before_=now),
    )
    with get_client(sync_client=True) as client:
        submissions = FlowFilter(name=FlowFilterName(any_=[BATCH_DEPLOYMENT.split("/")[0]]))
        for run in client.read_flow_runs(flow_run_filter=late, flow_filter=submissions):
            if run.parameters.get("name") == batch:
                client.set_flow_run_state(run.id, Cancelled(message="a later one has submitted the batch"))


def cancel(rows: Sequence[VideoRow]) -> None:
    """Set the flow runs of these videos to `Cancelled`; those that Prefect does not have are left out."""
    with get_client(sync_client=True) as client:
        for run in [row.flow_run for row in rows if row.flow_run]:
            try:
                client.set_flow_run_state(UUID(run), Cancelled(message="humanmm batch cancel"), force=True)
            except ObjectNotFound:
                log.info("Prefect has no flow run %s", run)


def _pause_s(row: VideoRow) -> float:
    return 10.0 * 4 ** (row.losses - 1) if row.losses else 0.0


def queue_of(priority: str) -> str:
    """Name of the work queue for a priority; `default` is the one that every work pool has."""
    return "default" if priority == "normal" else priority


def _parameters(row: VideoRow, table: BatchTable) -> dict[str, Any]:
    return {
        "video": row.video,
        "out": row.run_dir,
        "config": json.loads(row.config),
        "store": table.store.location,
        "batch": row.batch,
        "attempt": row.attempt,
    }
