"""The end of a run: the run folder and run.json, written from the artifacts in the store."""

import functools
import hashlib
import logging
import os
import platform
import socket
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from humanmm.config import Config
from humanmm.corrections import Corrections
from humanmm.errors import HumanMMError, StageError, StoreError
from humanmm.models.records.motion import WorldMotion
from humanmm.models.records.shots import ShotList
from humanmm.models.records.video import VideoFacts
from humanmm.storage.run_folder.run_record import (
    LOCK,
    StageRecord,
    begin_run_record,
    read_run_record,
    run_record,
    write_run_record,
)
from humanmm.storage.store.codec import canonical_json
from humanmm.storage.store.files import OTHER_FOLDER, explain_os_error, replace_file
from humanmm.storage.store.locks import FileLock
from humanmm.storage.store.video_records import TIME, RunNote
from humanmm.tasks.engine.corrections import outcomes
from humanmm.tasks.engine.run import VideoRun
from humanmm.tasks.pipeline import Stage
from humanmm.tasks.units.artifacts import Outcome
from humanmm.tasks.units.digest import CodeDigest
from humanmm.tasks.units.execute import output_type
from humanmm.tasks.units.faults import ends_run, is_infrastructure_fault
from humanmm.tasks.units.unit import Unit
from humanmm.version import __version__

if TYPE_CHECKING:  # importing it loads scipy, which an unchanged rerun does not need
    from humanmm.models.records.recording import Delivery

log = logging.getLogger(__name__)
RUN_LOG = "run.log"


def default_run_dir(video: Path) -> Path:
    """runs/<stem of the video>, unsafe characters replaced."""
    stem = "".join(c if c.isalnum() or c in "-_.+=@" else "_" for c in video.stem).strip(".")[:120]
    return Path("runs") / (stem or "video")


def fatal_error(run: VideoRun) -> Exception | None:
    """The error that ended the run: of a stage per video, or of one that failed on all its units.

    If an infrastructure fault left the inputs of the failed stage incomplete, that fault is the error.
    """
    failed = [outcome for outcome in failures(run) if outcome.error]
    hopeless = any(outcome.manifest is None for outcome in run.outcomes.values() if outcome.unit.stage.per == "video")
    for outcome in failed:
        if outcome.unit.stage.per == "video" or ends_run(outcome.error or Exception()):
            before = run.upstream(outcome.unit.stage)
            causes = [other.error for other in failed if other.unit.stage.name in before and other.error]
            return next(filter(is_infrastructure_fault, causes), outcome.error)
    if hopeless:
        return failed[0].error if failed else StageError("the run stopped before its last stage")
    return None


def failures(run: VideoRun) -> list[Outcome]:
    """Units that failed by themselves, in order, without those skipped because of them."""
    return [outcome for outcome in _in_order(run) if outcome.state == "failed"]


def has_result(run: VideoRun) -> bool:
    """True if every stage per video has its artifact, so that a run folder can be written."""
    return all(run.manifest(stage.name) is not None for stage in run.stages if stage.per == "video")


def write_results(run: VideoRun, run_dir: Path, *, started: float, log_text: str = "") -> str:
    """Bring the run folder up to date; returns the state of the video, `done` or `partial`.

    Of two runs that write one folder the later waits for the other, and says so. While it is written its
    run.json says that: where the writing breaks off, nobody takes the old record for that of the new motion.
    """
    state = "partial" if any(outcome.manifest is None for outcome in run.outcomes.values()) else "done"
    from humanmm.tasks.pictures import EMBEDDED, write_scene, write_timeline

    waiting = f"another run is writing {run_dir}; waiting for it"
    try:
        with FileLock(run_dir / LOCK, waiting=waiting, level=logging.WARNING, other=OTHER_FOLDER).held():
            begin_run_record(run_dir)
            delivery, blob_dir = _write_folder(run, run_dir)
            recording = delivery.recording
            if log_text:
                _append_log(run_dir / RUN_LOG, log_text)
            record = _record(run, state, started, delivery)
            write_timeline(run_dir, recording, record)
            write_scene(run_dir, recording, record, blob_dir / EMBEDDED)
            record["fingerprint"] = fingerprint(run)
            record["files"] = _sizes(run_dir)
            write_run_record(run_dir, record)
    except OSError as error:
        what = f"cannot write the run folder {run_dir}"
        raise StoreError(explain_os_error(error, what, other=OTHER_FOLDER)) from error
    reasons = "; ".join(f"{outcome.unit.label}: {outcome.reason}" for outcome in failures(run))
    remember(run, state, run_dir=run_dir, reason=reasons)
    log.info("%s: %s", run_dir, state)
    return state


def remember(run: VideoRun, state: str, *, run_dir: Path | None, reason: str) -> None:
    """Write to the store how the run ended, for which reason, and which artifacts it found or computed."""
    before = run.store.last_run(run.video.sha256) if state == "failed" else None
    result = () if before is None else before.result if before.state == "failed" else before.artifacts
    note = RunNote(
        video=run.video.sha256,
        state=state,
        path=os.fspath(run.video.path.absolute()),
        run_dir=os.fspath(run_dir.absolute()) if run_dir else None,
        host=socket.gethostname(),
        reason=reason,
        recipe=recipe_of(code_of(run.stages, run.keys.code), run.config) if state == "done" else "",
        artifacts=tuple(outcome.manifest.ref.uri for outcome in _in_order(run) if outcome.manifest),
        result=result,
        finished=time.strftime(TIME),
    )
    run.store.note_run(note)


def code_of(stages: Sequence[Stage], code: Callable[[Stage], CodeDigest]) -> str:
    """Digest of the code, weights and libraries of all stages, and of the code that writes run folders."""
    found = [code(stage) for stage in stages]
    names = [[stage.name, stage.schema_version] for stage in stages]
    facts = [
        __version__,
        _writer_digest(),
        names,
        [[dict(one.modules), dict(one.weights), dict(one.libraries)] for one in found],
    ]
    return hashlib.sha256(canonical_json([repr(fact) for fact in facts]).encode()).hexdigest()


def recipe_of(code: str, config: Config) -> str:
    """Digest of everything beside the video that decides its results: with an equal one they need no new run."""
    kept = {name: section.facts for name, section in config if name not in ("run", "corrections")}
    if config.corrections.correction:
        kept["corrections"] = config.corrections.facts
    return hashlib.sha256(f"{code}{canonical_json(kept)}".encode()).hexdigest()


def is_up_to_date(run: VideoRun, run_dir: Path) -> bool:
    """True if the run folder already holds exactly what `write_results` would write."""
    try:
        record = read_run_record(run_dir)
        if record.get("state") != "done" or record.get("fingerprint") != fingerprint(run):
            return False
        return all((run_dir / path).stat().st_size == size for path, size in record["files"].items())
    except (HumanMMError, OSError, KeyError, AttributeError):
        return False


def fingerprint(run: VideoRun) -> str:
    """Digest of everything that a run folder is made of."""
    results = {outcome.unit.label: outcome.manifest.digest for outcome in _in_order(run) if outcome.manifest}
    facts = [__version__, _writer_digest(), os.fspath(run.video.path), run.video.sha256, _settings(run), results]
    return hashlib.sha256(canonical_json([repr(fact) for fact in facts]).encode()).hexdigest()


def _settings(run: VideoRun) -> dict[str, Any]:
    """The configuration; without corrections, it does not say where they were looked for."""
    config = run.config
    if not config.corrections.correction and not config.corrections.left_aside:
        config = config.model_copy(update={"corrections": Corrections()})
    return config.model_dump(mode="json")


@functools.cache
def _writer_digest() -> str:
    """Digest of the code that writes run folders."""
    storage = Path(__file__).resolve().parents[2] / "storage"
    total = hashlib.sha256(Path(__file__).read_bytes())
    for folder in ("run_folder", "view", "pages"):
        for path in sorted(path for path in (storage / folder).rglob("*") if path.suffix in (".py", ".js", ".html")):
            total.update(path.read_bytes())
    return total.hexdigest()


def _write_folder(run: VideoRun, run_dir: Path) -> "tuple[Delivery, Path]":
    """Write the delivery's files; returns the delivery, and the folder of its artifact's files."""
    from humanmm.storage.run_folder.motion_zarr import write_run_folder

    last = run.stages[-1]
    manifest = run.manifest(last.name)
    assert manifest is not None
    delivery: Delivery = run.read(Unit(last), output_type(last))
    blob_dir = run.store.files_of(manifest.ref)
    write_run_folder(run_dir, delivery, blob_dir)
    return delivery, blob_dir


def _sizes(run_dir: Path) -> dict[str, int]:
    """Path → size of every file of the delivery in the folder; other exports and films are the user's."""
    from humanmm.storage.run_folder.exporters import always_written
    from humanmm.storage.run_folder.motion_zarr import ASKED_VIEWS, EXPORT

    parts = always_written(run_dir / EXPORT)
    parts += [path for name in ("motion.zarr", "view") for path in (run_dir / name).rglob("*")]
    return {
        str(path.relative_to(run_dir)): path.stat().st_size
        for path in sorted(parts)
        if path.is_file() and path.name not in ASKED_VIEWS
    }


def _record(run: VideoRun, state: str, started: float, delivery: "Delivery") -> dict[str, Any]:
    from humanmm.models.records.camera import Intrinsics, ShotCamera

    intrinsics = next(stage for stage in run.stages if stage.output.endswith(":Intrinsics"))
    camera_stage = next(stage for stage in run.stages if stage.output.endswith(":ShotCamera"))
    shot_source = next(stage for stage in run.stages if stage.defines == "shot")
    shots = run.read(Unit(shot_source), ShotList)
    motion_source = next((stage for stage in reversed(run.stages) if stage.output.endswith(":WorldMotion")), None)
    stages = [stage_record(outcome) for outcome in _in_order(run)]
    return run_record(
        state=state,
        video=run.video.path,
        sha256=run.video.sha256,
        store=run.store.location,
        config=_settings(run),
        facts=run.read(Unit(run.stages[0]), VideoFacts),
        shots=shots,
        intrinsics=run.read(Unit(intrinsics), Intrinsics),
        cameras=[
            run.read(unit, ShotCamera) if run.manifest(*unit.id) else None for unit in run.units(camera_stage) or ()
        ],
        motion=run.read(Unit(motion_source), WorldMotion) if motion_source else None,
        stages=stages,
        corrections=outcomes(run.config, shots, video=run.video.sha256),
        guesses=delivery.guesses,
        started=time.strftime("%Y-%m-%dT%H:%M:%S%z", time.localtime(started)),
        seconds=time.time() - started,
        versions=_versions(run),
    )


def stage_record(outcome: Outcome) -> StageRecord:
    """One line of run.json's `stages`."""
    manifest, unit = outcome.manifest, outcome.unit
    return StageRecord(
        stage=unit.stage.name,
        unit=unit.name,
        shot=unit.index if unit.stage.per == "shot" else None,
        state=outcome.state,
        reason=outcome.reason,
        began=outcome.began,
        seconds=outcome.seconds,
        computed_seconds=manifest.seconds if manifest else None,
        attempts=outcome.attempts,
        faults=tuple(outcome.faults),
        key=manifest.recipe.key if manifest else None,
        digest=manifest.digest if manifest else None,
        warnings=manifest.warnings if manifest else (),
    )


def _in_order(run: VideoRun) -> list[Outcome]:
    names = [stage.name for stage in run.stages]
    return sorted(run.outcomes.values(), key=lambda o: (names.index(o.unit.stage.name), o.unit.index))


def _versions(run: VideoRun) -> Mapping[str, str]:
    versions = {"humanmm": __version__, "python": platform.python_version()}
    for outcome in _in_order(run):
        if outcome.manifest:
            libraries = outcome.manifest.recipe.libraries
            versions.update({name: version for name, version in libraries.items() if name != "python"})
    return versions


def _append_log(path: Path, text: str) -> None:
    older = path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""
    replace_file(path, lambda fresh: _write(fresh, older + text))


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", errors="backslashreplace")
