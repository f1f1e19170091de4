"""What the dashboard shows beside flow runs and tasks: progress of long stages, a page a video, a table a batch."""

import contextlib
import hashlib
import json
import logging
import re
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from uuid import UUID

from prefect import get_client
from prefect.client.orchestration import SyncPrefectClient
from prefect.client.schemas.actions import ArtifactCreate, ArtifactUpdate
from prefect.client.schemas.filters import ArtifactFilter, ArtifactFilterKey

from humanmm.storage.batches.video_row import VideoRow, counts_in_words
from humanmm.storage.pages.markdown import escaped
from humanmm.storage.pages.video_page import batch_table, failure_page, video_page
from humanmm.storage.run_folder.run_record import read_run_record
from humanmm.tasks.units.unit import Unit

log = logging.getLogger(__name__)

LONG_S = 10.0
"""A stage that takes longer has its progress shown."""
LOOK_S = 5.0
EVERY_S = 15.0
"""Each update costs the server and the video a few hundredths of a second of processor time."""


class ProgressBoard:
    """Progress of the long stages of one flow run. Reports cost nothing; one thread sends them to the server."""

    def __init__(self, flow_run: UUID) -> None:
        self._flow_run = flow_run
        self._begun: dict[str, tuple[UUID, float]] = {}
        self._now: dict[str, tuple[float, float]] = {}
        """The percentage of each, and how many seconds after its begin that was."""
        self._sent: dict[str, tuple[UUID, float, float]] = {}
        """The artifact of each, its percentage, and when that was sent (monotonic seconds)."""
        self._over = threading.Event()
        self._thread: threading.Thread | None = None

    def begin(self, unit: Unit, task_run: UUID) -> None:
        """Note the task run that computes a unit."""
        self._begun[unit.label] = (task_run, time.monotonic())

    def report(self, unit: Unit, done: int, total: int) -> None:
        """Note the progress of a stage."""
        _, begun = self._begun.get(unit.label, (None, time.monotonic()))
        self._now[unit.label] = 100.0 * done / max(total, 1), time.monotonic() - begun
        if self._thread is None:
            self._thread = threading.Thread(target=self._send, name="progress", daemon=True)
            self._thread.start()

    def end(self) -> None:
        """Send nothing more."""
        self._over.set()
        if self._thread is not None:
            self._thread.join()

    def _send(self) -> None:
        with contextlib.ExitStack() as stack:
            client, over = None, False
            while not over:
                over = self._over.wait(LOOK_S)
                due = [label for label in list(self._now) if self._is_due(label, over=over)]
                if not due:
                    continue
                try:
                    client = client or stack.enter_context(get_client(sync_client=True))
                    for label in due:
                        self._show(client, label, self._now[label][0])
                except Exception as error:  # a picture of the progress is worth no failure
                    log.info("progress could not be shown: %s", error)

    def _is_due(self, label: str, *, over: bool) -> bool:
        percent, lasted_s = self._now[label]
        if label not in self._sent:
            return lasted_s > LONG_S
        _, sent, at = self._sent[label]
        return percent != sent and (over or time.monotonic() - at >= EVERY_S)

    def _show(self, client: SyncPrefectClient, label: str, percent: float) -> None:
        if label in self._sent:
            artifact = self._sent[label][0]
            client.update_artifact(artifact, ArtifactUpdate(data=percent))
        else:
            task_run = self._begun[label][0]
            progress = ArtifactCreate(
                type="progress", description=label, data=percent, flow_run_id=self._flow_run, task_run_id=task_run
            )
            artifact = client.create_artifact(progress).id
        self._sent[label] = (artifact, percent, time.monotonic())


def show_video(run_dir: Path, flow_run: UUID) -> None:
    """Put a page of a finished video on the dashboard, under its flow run and under a key of its own."""
    record = read_run_record(run_dir)
    video = record["video"]
    _show_page(
        key=_page_key(run_dir, video["sha256"]),
        title=f"{escaped(Path(video['path']).name)}: {record['state']}",
        text=video_page(record, run_dir),
        flow_run=flow_run,
    )


def show_failure(
    video: Path,
    reason: str,
    stages: Sequence[Mapping[str, Any]],
    run_dir: Path,
    flow_run: UUID,
    *,
    sha256: str | None = None,
) -> None:
    """Put a page of a video that failed on the dashboard; `stages`: as run.json has them, as far as it came."""
    _show_page(
        key=_page_key(run_dir, sha256 or ""),
        title=f"{escaped(video.name)}: failed",
        text=failure_page(video, reason, stages, run_dir),
        flow_run=flow_run,
    )


def _page_key(run_dir: Path, sha256: str) -> str:
    return "-".join(filter(None, ("video", _key(run_dir.name), sha256[:8])))


def _show_page(*, key: str, title: str, text: str, flow_run: UUID) -> None:
    page = ArtifactCreate(key=key, type="markdown", description=title, data=text, flow_run_id=flow_run)
    try:
        with get_client(sync_client=True) as client:
            client.create_artifact(page)
    except Exception as error:  # the result is written; its page is not worth its loss
        log.info("the page of the video could not be shown: %s", error)


def show_batch(client: SyncPrefectClient, name: str, rows: Sequence[VideoRow]) -> None:
    """Put the table of a batch on the dashboard, in place of the one before."""
    key = f"batch-{_key(name)}"
    data = json.dumps(batch_table(rows))
    described = f"batch {escaped(name)}: {counts_in_words(rows)}"
    found = client.read_artifacts(artifact_filter=ArtifactFilter(key=ArtifactFilterKey(any_=[key])), limit=1)
    if found:
        client.update_artifact(found[0].id, ArtifactUpdate(data=data, description=described))
    else:
        client.create_artifact(ArtifactCreate(key=key, type="table", description=described, data=data))


def _key(name: str) -> str:
    """Letters, digits and dashes, as the keys of artifacts are, and digits of a name that has others."""
    plain = re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")
    digits = "" if plain == name else hashlib.sha256(name.encode(errors="surrogateescape")).hexdigest()[:8]
    return "-".join(filter(None, (plain, digits)))
