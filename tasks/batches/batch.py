"""Many videos: what of a batch is to be done, and the account of one video while it runs. Needs no Prefect.

What a batch asks for is compared with the ledger and the store before anything is scheduled: a video is finished if
the same file was finished with the same code, weights, libraries and settings and its run folder is still there.
"""

import contextlib
import hashlib
import json
import logging
import os
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from humanmm.config import Config
from humanmm.config_reading import validate
from humanmm.errors import InputError, StoreError, VideoError
from humanmm.parts import Part, chosen
from humanmm.storage.batches.batch_ledger import BatchLedger, VideoRow, facts_of, has_run_record
from humanmm.storage.batches.manifest import Entry
from humanmm.storage.store.identity import identify, known_content
from humanmm.storage.store.store import Store
from humanmm.tasks import pipeline
from humanmm.tasks.engine import finish
from humanmm.tasks.engine.plan import forecast, is_complete
from humanmm.tasks.engine.run import VideoRun
from humanmm.tasks.pipeline import Stage
from humanmm.tasks.units.digest import CodeDigest, code_digest
from humanmm.tasks.units.faults import in_words, is_infrastructure_fault

log = logging.getLogger(__name__)
T = TypeVar("T")
LOOK_EVERY_S = 1.0
WAITS_S = (1.0, 4.0, 15.0, 30.0)
"""Between tries to write down what becomes of a video: a disk that is full for half a minute costs it no attempt."""
ASK_EVERY_S = 10.0
"""How often a process that computes a video asks whether it is still to: others may have cancelled it."""


@dataclass(frozen=True)
class Submission:
    """What a batch asks for, seen against what is there already."""

    name: str
    to_schedule: tuple[VideoRow, ...]
    """Written down as scheduled; whoever runs flows is told now."""
    finished: int
    """Videos that need nothing."""
    failed: int
    """Videos that failed before, in the same way as they would now: `retry-failed` runs them again."""


def batch_name(source: Path) -> str:
    """Name of a batch that was given none: of its folder or manifest, and a few digits of where that lies."""
    path = source.absolute()
    return f"{finish.default_run_dir(path).name}-{hashlib.sha256(os.fsencode(path)).hexdigest()[:8]}"


def submit(
    ledger: BatchLedger, name: str, source: Path, entries: Sequence[Entry], config: Config, out: Path
) -> Submission:
    """Write a batch down. What is written already and asks for the same stays as it is, whatever its state.

    InputError if a video is running with other settings, or was submitted with others by somebody else just now.
    """
    known = {row.video: row for row in ledger.rows(name)}
    asked = _rows(name, entries, config, out.absolute(), ledger.store, known)
    finished = ledger.finished()
    written: list[VideoRow] = []
    rows = {row.video: known.get(row.video, row) for row in asked}
    for row in asked:
        before = known.get(row.video)
        if (
            before is not None
            and before.same_work(row)
            and not (before.state == "done" and _is_gone(before.run_dir, before.host))
        ):
            continue
        attempt = before.attempt + 1 if before else 1
        if before is not None and before.state == "running" and ledger.is_held(before):
            raise InputError(f"{row.video} is running with other settings; wait for it or `humanmm batch cancel` first")
        host = _finished_on(row, finished, ledger.store)
        state = "scheduled" if host is None else "done"
        written.append(replace(row, attempt=attempt, state=state, host=host or ""))
    standing = ledger.put(name, str(source.absolute()), written) if written else []
    for ours, row in zip(written, standing, strict=True):
        if not row.same_work(ours):
            raise InputError(f"{row.video} was submitted with other settings by somebody else just now")
        rows[row.video] = row
    states = [row.state for row in rows.values()]
    return Submission(
        name=name,
        to_schedule=tuple(row for row in rows.values() if row.state == "scheduled"),
        finished=states.count("done"),
        failed=sum(states.count(state) for state in ("failed", "partial", "cancelled")),
    )


def retry(ledger: BatchLedger, name: str, *, stage: str | None = None) -> list[VideoRow]:
    """Schedule again what failed, is partial or was cancelled; with `stage`, only what failed there."""
    again = []
    for row in ledger.rows(name, "failed", "partial", "cancelled"):
        if stage is None or (row.stage or "").split(" · ")[0] == stage:
            fresh = replace(row, attempt=row.attempt + 1, state="scheduled", stage=None, reason="", seconds=None)
            again.append(replace(fresh, flow_run=None, pid=None, losses=0))
    return [row for row in ledger.put(name, "", again) if row.state == "scheduled"] if again else []


# ---- one video of a batch


class Account:
    """Keeps the ledger's row of one running video up to date."""

    def __init__(self, ledger: BatchLedger, row: VideoRow) -> None:
        self.ledger, self.row = ledger, row
        self.run: VideoRun | None = None
        """Set by the flow when the video is open."""
        self.flow_run: str | None = None
        """Prefect's name of what runs it."""
        self._left = threading.Event()
        self._stage: str | None = None

    def end(self, state: str, reason: str) -> None:
        """Note how it ended, unless somebody has cancelled it meanwhile."""
        stage = self._failed_stage() if state in ("failed", "partial") else None
        insist(lambda: self.ledger.change(self.row, only_from=("running",), state=state, reason=reason, stage=stage))

    def fail(self, error: Exception) -> None:
        """Note the error that ended it; a fault of the disk, the store or the machine has it tried again."""
        if is_infrastructure_fault(error):
            self._lose("failed", in_words(error))
        else:
            self.end("failed", in_words(error))

    def end_partial(self, reason: str) -> None:
        """Note that shots are missing; if nothing but such faults took them, have it tried again."""
        lost = finish.failures(self.run) if self.run else []
        if lost and all(is_infrastructure_fault(outcome.error or Exception()) for outcome in lost):
            self._lose("partial", reason)
        else:
            self.end("partial", reason)

    def _lose(self, state: str, reason: str) -> None:
        insist(lambda: self.ledger.lose(self.row, reason, state=state, stage=self._failed_stage()))

    @contextlib.contextmanager
    def kept(self, flow_run: str | None) -> Iterator[bool]:
        """Hold the video and tell where it is while the body runs; False if it is not to be run any more."""
        self.flow_run = flow_run
        with contextlib.ExitStack() as held_for:
            held = insist(lambda: held_for.enter_context(self.ledger.hold(self.row)))
            begun = time.time()
            values: dict[str, Any] = {"state": "running", "flow_run": flow_run, "pid": os.getpid(), "reason": ""}
            values["host"] = socket.gethostname()
            # the dashboard's own Retry runs a failed attempt again
            takes = ("scheduled", "running", "failed", "partial", "done")
            ready = held and insist(lambda: self.ledger.change(self.row, only_from=takes, **values))
            if not ready:
                yield False
                return
            reporter = threading.Thread(target=self._report, args=(begun,), daemon=True)
            reporter.start()
            try:
                yield True
            finally:
                self._left.set()
                reporter.join()
                insist(lambda: self.ledger.change(self.row, seconds=round(time.time() - begun, 3)))

    def _report(self, begun: float) -> None:
        asked = time.monotonic()
        while not self._left.wait(LOOK_EVERY_S):
            try:
                self._tell(begun)
                if time.monotonic() - asked > ASK_EVERY_S:
                    asked = time.monotonic()
                    if self._is_over():
                        log.warning("%s is no longer to be computed here", self.row.video)
                        os.kill(os.getpid(), signal.SIGTERM)
                        return
            except StoreError as error:  # the next look will do
                log.info("the ledger did not answer: %s", error)

    def _tell(self, begun: float) -> None:
        if self.row.losses and self._has_computed():
            self.row = replace(self.row, losses=0)
            self.ledger.change(self.row, losses=0)
        stage = self._current_stage()
        if stage != self._stage:
            self._stage = stage
            seconds = round(time.time() - begun, 3)
            self.ledger.change(self.row, only_from=("running",), stage=stage, seconds=seconds)

    def _has_computed(self) -> bool:
        """Whether there is something now that there was not before this attempt."""
        return any(o.state == "computed" for o in list(self.run.outcomes.values())) if self.run else False

    def _is_over(self) -> bool:
        row = self.ledger.row(self.row.batch, self.row.video)
        return row is None or row.attempt != self.row.attempt or row.state == "cancelled"

    def _current_stage(self) -> str | None:
        outcomes = list(self.run.outcomes.values()) if self.run else []
        at_work = [o.unit.label for o in outcomes if o.began and o.manifest is None and o.error is None]
        return at_work[0] if at_work else self._stage

    def _failed_stage(self) -> str | None:
        failed = finish.failures(self.run) if self.run else []
        return failed[0].unit.label if failed else self._stage


def insist(ask: Callable[[], T]) -> T:
    """What a question to the ledger gives; tried again for a minute if it cannot be read or written."""
    for wait_s in WAITS_S:
        try:
            return ask()
        except StoreError as error:
            log.warning("%s; tried again in %g s", error, wait_s)
            time.sleep(wait_s)
    return ask()


# ---- what a batch asks for


def _rows(
    name: str, entries: Sequence[Entry], config: Config, out: Path, store: Store, known: Mapping[str, VideoRow]
) -> list[VideoRow]:
    code_of_parts: dict[tuple[Part, ...], str] = {}
    resolved: dict[str, tuple[str, str]] = {}  # overrides → configuration as json, recipe
    base = config.model_dump(mode="json")
    folders = _RunFolders(out, store, known)
    rows = []
    for position, entry in enumerate(entries):
        video = _as_text(entry.video)
        overrides = json.dumps(entry.settings, sort_keys=True)
        if overrides not in resolved:
            tree = {k: {**v, **entry.settings.get(k, {})} for k, v in base.items()} if entry.settings else base
            unknown = {k: v for k, v in entry.settings.items() if k not in tree}
            settings = validate({**tree, **unknown}, origin=entry.origin)
            parts = chosen(settings, base)
            if parts not in code_of_parts:
                code_of_parts[parts] = finish.code_of(pipeline.STAGES, partial(_code_of_stage, settings))
            recipe = finish.recipe_of(code_of_parts[parts], settings)
            resolved[overrides] = json.dumps(settings.model_dump(mode="json")), recipe
        settings_json, recipe = resolved[overrides]
        rows.append(
            VideoRow(
                batch=name, video=video, position=position, run_dir=folders.folder(entry), config=settings_json,
                priority=entry.priority or "normal", tags=json.dumps(entry.tags), facts=facts_of(entry.video),
                recipe=recipe,
            )
        )  # fmt: skip
    return rows


def _code_of_stage(settings: Config, stage: Stage) -> CodeDigest:
    return code_digest(stage.function[0], chosen(settings, stage.settings))


class _RunFolders:
    """A run folder per video: its stem; with eight digits of its content if another video has that stem."""

    def __init__(self, out: Path, store: Store, known: Mapping[str, VideoRow]) -> None:
        self._out, self._store = out, store
        self._known = {video: row.run_dir for video, row in known.items() if Path(row.run_dir).parent == out}
        self._taken = set(self._known.values())

    def folder(self, entry: Entry) -> str:
        video = str(entry.video)
        if entry.out is not None:
            path = os.path.normpath(self._out / entry.out)
            if path in self._taken and self._known.get(video) != path:
                raise InputError(f"{entry.origin}: the run folder {path} is another video's")
        elif video in self._known:
            return self._known[video]
        else:
            plain = str(self._out / finish.default_run_dir(entry.video).name)
            path = self._free(plain, entry.video) if plain in self._taken else plain
        self._taken.add(path)
        return path

    def _free(self, plain: str, video: Path) -> str:
        try:
            digest = identify(video, self._store).sha256
        except VideoError:  # it will fail with its reason, and write no folder
            digest = hashlib.sha256(os.fsencode(video)).hexdigest()
        path, count = f"{plain}-{digest[:8]}", 1
        while path in self._taken:  # the same video twice under one name
            count += 1
            path = f"{plain}-{digest[:8]}-{count}"
        return path


def _is_gone(run_dir: str, host: str) -> bool:
    """Whether a finished run folder is no longer there; of another machine's that cannot be told."""
    return host in ("", socket.gethostname()) and not has_run_record(run_dir)


def _finished_on(row: VideoRow, finished: Mapping[tuple[str, str, str], tuple[str, str]], store: Store) -> str | None:
    """Where its run folder is if nothing has to be computed; one that is missing is then written from the store."""
    if not row.facts:
        return None
    run_dir, host = finished.get((row.video, row.facts, row.recipe), ("", ""))
    if run_dir == row.run_dir and not _is_gone(run_dir, host):
        return host
    sha256 = _known_content(row, store)
    last = store.last_run(sha256) if sha256 is not None else None
    if last is None:
        return None
    asked, made = (row.recipe, row.video, row.run_dir), (last.recipe, last.path, last.run_dir)
    if asked == made and not _is_gone(row.run_dir, last.host):
        return last.host
    began = time.time()
    run = VideoRun(identify(Path(row.video), store), Config.model_validate_json(row.config), store)
    if not is_complete(forecast(run)):
        return None
    folder = Path(row.run_dir)
    if not finish.is_up_to_date(run, folder):
        finish.write_results(run, folder, started=began, log_text="written from the store alone\n")
    return socket.gethostname()


def _known_content(row: VideoRow, store: Store) -> str | None:
    """Content hash of a video that was hashed before; new videos are hashed by the process that computes them."""
    known = known_content(Path(row.video), store)
    same = [known.get("size"), known.get("mtime_ns"), known.get("inode")] == json.loads(row.facts)
    return str(known["sha256"]) if same else None


def _as_text(video: Path) -> str:
    try:
        str(video).encode()
    except UnicodeEncodeError:
        raise InputError(f"the name {str(video)!a} is no text; rename the file to use it in a batch") from None
    return str(video)
