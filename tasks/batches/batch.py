"""Which videos of a batch are to be computed. Needs no Prefect.

A submitted batch is compared with the batch table and the store before anything is scheduled: a video is finished if
the same file was finished with the same code, weights, libraries and settings, and its run folder is still there and
was not written again since, by `humanmm recover` with other settings for one.
"""

import contextlib
import functools
import hashlib
import json
import logging
import os
import socket
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from humanmm.config import Config
from humanmm.config_reading import resolve, validate, with_sections
from humanmm.errors import InputError, VideoError
from humanmm.parts import Part, chosen
from humanmm.storage.batches.batch_table import BatchTable
from humanmm.storage.batches.manifest import Entry
from humanmm.storage.batches.video_row import FACTS, VideoRow, facts_of, may_be_same, recorded_at
from humanmm.storage.run_folder.corrections_file import FILE as CORRECTIONS
from humanmm.storage.run_folder.corrections_file import decided
from humanmm.storage.store.identity import identify, known_content
from humanmm.storage.store.store import Store
from humanmm.tasks import pipeline
from humanmm.tasks.engine import finish
from humanmm.tasks.engine.plan import forecast, is_complete
from humanmm.tasks.engine.run import VideoRun
from humanmm.tasks.engine.run_folders import RunFolders
from humanmm.tasks.pipeline import Stage
from humanmm.tasks.units.digest import CodeDigest, code_digest

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Submission:
    """A batch as submitted, compared with what is there already."""

    name: str
    to_schedule: tuple[VideoRow, ...]
    """Rows in state scheduled: each gets a flow run now."""
    finished: int
    """Videos that need nothing."""
    failed: int
    """Videos that failed before, in the same way as they would now: `retry-failed` runs them again."""
    outdated: tuple[str, ...] = ()
    """Videos that are running with another file, other settings or code than wanted: they are left alone."""
    displaced: Mapping[str, str] = field(default_factory=dict)
    """Videos whose run folder holds a different result of another batch, which is written over → that batch."""

    @property
    def sentence(self) -> str:
        """Its figures in words."""
        counted = f"{len(self.to_schedule)} to do, {self.finished} finished"
        again = f", {self.failed} failed or cancelled before (`humanmm batch retry-failed` tries them again)"
        left = f", {len(self.outdated)} running as asked for before: submit again when they have ended"
        others = ", ".join(sorted(set(self.displaced.values())))
        over = (
            f"; {len(self.displaced)} write over run folders of batch {others}, with another result: --out keeps both"
        )
        parts = (again if self.failed else "", left if self.outdated else "", over if self.displaced else "")
        return counted + "".join(parts)


def batch_name(source: Path) -> str:
    """Name of a batch that was given none: of its folder or manifest, and a few digits of where that lies."""
    path = source.absolute()
    return f"{finish.default_run_dir(path).name}-{hashlib.sha256(os.fsencode(path)).hexdigest()[:8]}"


def submit(table: BatchTable, name: str, entries: Sequence[Entry], config: Config, out: Path) -> Submission:
    """Write the rows of a batch. A row that wants the same work already stays as it is, whatever its state, unless it
    has no whole result and its stages are to be run in another way now (`run.*`: limits). One that is running stays.

    InputError if a video was submitted with other settings by somebody else just now.
    """
    before = {row.video: row for row in table.rows(name)}
    wanted = _rows(name, entries, config, out.absolute(), table.store, before)
    rewritten = table.rewritten()
    finished = table.finished(rewritten)
    fresh: list[VideoRow] = []
    outdated: list[str] = []
    for row in wanted:
        known = before.get(row.video)
        is_other = (name, row.video) in rewritten or (known is not None and _is_other(known))
        if known is not None and known.same_work(row) and not is_other and not _is_run_otherwise(known, row):
            continue
        if known is not None and _is_running(known):
            outdated.append(row.video)
            continue
        host = _finished_on(row, finished, table.store)
        state = "scheduled" if host is None else "done"
        fresh.append(replace(row, attempt=known.attempt + 1 if known else 1, state=state, host=host or ""))
    standing = {row.video: row for row in table.put(fresh)}
    for row in fresh:
        if not row.same_work(standing[row.video]):
            raise InputError(f"{row.video} was submitted with other settings by somebody else just now")
    displaced = table.displaced(name) if fresh else {}
    rows = [standing.get(row.video) or before[row.video] for row in wanted]
    states = [row.state for row in rows]
    return Submission(
        name=name,
        to_schedule=tuple(row for row in rows if row.state == "scheduled"),
        finished=states.count("done"),
        failed=sum(states.count(state) for state in ("failed", "partial", "cancelled")),
        outdated=tuple(outdated),
        displaced={video: other for video, other in displaced.items() if video in standing},
    )


def _is_running(known: VideoRow) -> bool:
    return known.state == "running" and known.is_owned


def _is_run_otherwise(known: VideoRow, row: VideoRow) -> bool:
    """Whether it has no whole result, and its stages are to be run with other `run.*` than they were."""
    if known.state in ("done", "running"):
        return False
    before, now = (json.loads(one.config).get("run") for one in (known, row))
    return bool(before != now)


_REWRITTEN = "its run folder was rewritten by batch {}"
_GONE, _AGAIN = "its run folder is gone", "its run folder was written again since"
_CHANGED = "code, settings or corrections have changed"
_TO_WRITE = "the store has everything, only its run folder is to be written"


@dataclass(frozen=True)
class Planned:
    """What submitting a batch would do with one video."""

    row: VideoRow
    state: str
    """`to do`, `finished`, or the state that it keeps."""
    reason: str

    @property
    def sentence(self) -> str:
        return f"{self.state}{f': {self.reason}' if self.reason else ''}"

    def to_json(self) -> dict[str, Any]:
        return {"video": self.row.video, "run_dir": self.row.run_dir, "state": self.state, "reason": self.reason}


def forecast_submission(
    table: BatchTable, name: str, entries: Sequence[Entry], config: Config, out: Path
) -> list[Planned]:
    """What `submit` would do with each video. Writes nothing, if the store of the table is opened to read only."""
    before = {row.video: row for row in table.rows(name)}
    rewritten = table.rewritten()
    finished = table.finished(rewritten)
    return [
        _planned(row, before.get(row.video), finished, table.store, rewritten.get((name, row.video)))
        for row in _rows(name, entries, config, out.absolute(), table.store, before)
    ]


def _planned(
    row: VideoRow,
    known: VideoRow | None,
    finished: Mapping[tuple[str, str, str], tuple[str, str, float]],
    store: Store,
    rewritten_by: str | None,
) -> Planned:
    if not row.facts:
        return Planned(row, "to do", "there is no such file: it will fail")
    if known is not None and known.same_work(row):
        if _is_run_otherwise(known, row):
            return Planned(row, "to do", f"{known.state} before, with other settings of `run`")
        if known.state != "done":
            words = {"scheduled": "to do", "failed": "failed before", "partial": "partial before"}
            return Planned(row, words.get(known.state, known.state), known.reason)
        if rewritten_by is None and not _is_other(known):
            return Planned(row, "finished", "")
    if known is not None and _is_running(known):
        changed = _what_changed(known, row, store)
        return Planned(row, "running", f"as asked for before; {changed}: submit again when it has ended")
    if _finished_on(row, finished, store) is not None:
        return Planned(row, "finished", "the run folder is as it would be")
    if known is not None:
        again = _GONE if recorded_at(known.run_dir) is None else _AGAIN
        other = _REWRITTEN.format(rewritten_by) if rewritten_by else again
        return Planned(row, "to do", other if known.same_work(row) else _what_changed(known, row, store))
    is_empty = json.loads(row.facts)[0] == 0
    return Planned(row, "to do", "it is empty: it will fail" if is_empty else "it is new")


def with_notes(table: BatchTable, rows: Sequence[VideoRow]) -> list[VideoRow]:
    """Rows of a batch; those that are done and whose run folder was written again since say so."""
    by = table.rewritten()
    again = [row for row in rows if _is_other(row) and recorded_at(row.run_dir) is not None]
    reasons = {(row.batch, row.video): _AGAIN for row in again}
    reasons |= {key: _REWRITTEN.format(name) for key, name in by.items()}
    return [replace(row, reason=reasons.get((row.batch, row.video), row.reason)) for row in rows]


def retry(
    table: BatchTable, name: str, *, stage: str | None = None, values: Mapping[str, Any] | None = None
) -> list[VideoRow]:
    """Schedule again what failed, is partial or was cancelled, unless it would fail again, since its file is to blame;
    with `stage`, only what failed there.

    `values` are settings `run.FIELD` in place of those that the videos were submitted with.
    """
    fresh: dict[str, Any] = {
        "state": "scheduled", "stage": None, "reason": "", "seconds": None, "flow_run": None, "hopeless": False
    }  # fmt: skip
    again = [
        replace(row, attempt=row.attempt + 1, losses=0, config=_with(row.config, values or {}), **fresh)
        for row in table.rows(name, "failed", "partial", "cancelled")
        if (stage is None or (row.stage or "").split(" · ")[0] == stage) and not row.fails_again
    ]
    return [row for row in table.put(again) if row.state == "scheduled"]


def _with(config: str, values: Mapping[str, Any]) -> str:
    """A configuration as json, with some values replaced."""
    return json.dumps(resolve(json.loads(config), values).model_dump(mode="json")) if values else config


# ---- the rows that a batch wants


def _rows(
    name: str, entries: Sequence[Entry], config: Config, out: Path, store: Store, before: Mapping[str, VideoRow]
) -> list[VideoRow]:
    code_of_parts: dict[tuple[Part, ...], str] = {}
    resolved: dict[str, tuple[Config, str, str, str]] = {}  # overrides → configuration, as json, code, recipe
    base = config.model_dump(mode="json")
    folders = _RunFolders(out, store, before)
    rows = []
    for position, entry in enumerate(entry for entry in entries if _has_text_name(entry.video)):
        overrides = json.dumps(entry.settings, sort_keys=True)
        if overrides not in resolved:
            settings = validate(with_sections(base, entry.settings), origin=entry.origin)
            parts = chosen(settings, base)
            if parts not in code_of_parts:
                code_of_parts[parts] = finish.code_of(pipeline.STAGES, functools.partial(_code_of_stage, settings))
            code = code_of_parts[parts]
            as_json, recipe = json.dumps(settings.model_dump(mode="json")), finish.recipe_of(code, settings)
            resolved[overrides] = settings, as_json, code, recipe
        settings, settings_json, code, recipe = resolved[overrides]
        run_dir = folders.folder(entry)
        if (Path(run_dir) / CORRECTIONS).is_file():
            recipe = finish.recipe_of(code, _corrected(settings, run_dir, entry.video, store))
        rows.append(
            VideoRow(
                batch=name, video=str(entry.video), position=position, run_dir=run_dir, config=settings_json,
                priority=entry.priority or "normal", tags=json.dumps(entry.tags), facts=facts_of(entry.video),
                recipe=recipe,
            )
        )  # fmt: skip
    return rows


def _corrected(settings: Config, run_dir: str, video: Path, store: Store) -> Config:
    """The settings with the corrections in the run folder; a mistake there is an error when the video is computed."""
    try:
        return decided(settings, Path(run_dir), sha256=identify(video, store).sha256)
    except InputError:
        return settings


def _code_of_stage(settings: Config, stage: Stage) -> CodeDigest:
    return code_digest(stage.function[0], chosen(settings, stage.settings))


class _RunFolders:
    """The run folder of each video of a batch: the one that it names, the one that it had, or one by its name."""

    def __init__(self, out: Path, store: Store, before: Mapping[str, VideoRow]) -> None:
        self._out = out
        self._before = {video: row.run_dir for video, row in before.items() if Path(row.run_dir).parent == out}
        self._folders = RunFolders(out, store, map(Path, self._before.values()))

    def folder(self, entry: Entry) -> str:
        video = str(entry.video)
        if entry.out is None:
            return self._before.get(video) or str(self._folders.of(entry.video))
        path = os.path.normpath(self._out / entry.out)
        if self._before.get(video) != path and not self._folders.take(Path(path)):
            raise InputError(f"{entry.origin}: the run folder {path} is another video's")
        return path


def _is_other(known: VideoRow) -> bool:
    """Whether it is done, and its run folder is no longer the one that it had written."""
    return known.state == "done" and not _is_kept(known.run_dir, known.host, known.changed)


def _is_kept(run_dir: str, host: str, ended: float) -> bool:
    """Whether a run folder is there and was not written again after its run had ended, seconds since 1970; of another
    machine's that is unknown. Where clocks differ it may be looked up without need."""
    if host not in ("", socket.gethostname()):
        return True
    recorded = recorded_at(run_dir)
    return recorded is not None and recorded <= ended


def _finished_on(
    row: VideoRow, finished: Mapping[tuple[str, str, str], tuple[str, str, float]], store: Store
) -> str | None:
    """The host of its run folder if that is as it would be: nothing has to be computed or written."""
    if not row.facts:
        return None
    run_dir, host, ended = finished.get((row.video, row.facts, row.recipe), ("", "", 0.0))
    if run_dir == row.run_dir and _is_kept(run_dir, host, ended):
        return host
    sha256 = _known_content(row, store)
    last = store.last_run(sha256) if sha256 is not None else None
    if last is None:
        return None
    wanted, made = (row.recipe, row.video, row.run_dir), (last.recipe, last.path, last.run_dir)
    if wanted == made and _is_kept(row.run_dir, last.host, last.ended):
        return last.host
    run = _run_of(row, store)
    is_whole = is_complete(forecast(run)) and finish.is_up_to_date(run, Path(row.run_dir))
    return socket.gethostname() if is_whole else None


def _run_of(row: VideoRow, store: Store) -> VideoRun:
    video = Path(row.video)
    config = _corrected(Config.model_validate_json(row.config), row.run_dir, video, store)
    return VideoRun(identify(video, store), config, store)


def _what_changed(known: VideoRow, row: VideoRow, store: Store) -> str:
    """Why a video is computed again: of its stages the first that would run says it."""
    if not may_be_same(known.facts, row.facts):
        return "the file has changed"
    if known.run_dir != row.run_dir:
        return "its run folder has changed"
    plan = forecast(_run_of(row, store)) if _known_content(row, store) is not None else []
    reasons = (f"{entry.stage}: {entry.reason}" for entry in plan if entry.state == "will run")
    return next(reasons, _TO_WRITE if plan else _CHANGED)


def _known_content(row: VideoRow, store: Store) -> str | None:
    """Content hash of a video that was hashed before; new videos are hashed by the process that computes them.

    One whose last change alone is another is hashed again here: a thousand files get a new mode or link at once, and
    hardly ever another content.
    """
    known = known_content(Path(row.video), store)
    facts = json.dumps([known.get(name) for name in FACTS])
    if facts == row.facts:
        return str(known["sha256"])
    with contextlib.suppress(VideoError):
        return identify(Path(row.video), store).sha256 if may_be_same(facts, row.facts) else None
    return None


@functools.cache
def _has_text_name(video: Path) -> bool:
    """Whether the batch table can hold its name. A watched folder is looked at again and again: it is told once."""
    try:
        str(video).encode()
    except UnicodeEncodeError:
        log.warning("the name %a is no text: the video is left out; rename the file to use it in a batch", str(video))
        return False
    return True
