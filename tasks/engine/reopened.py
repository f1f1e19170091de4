"""A finished run opened again from its folder: what its results were computed from, and what would run anew."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from humanmm.config_reading import validate
from humanmm.errors import InputError, VideoError
from humanmm.storage.run_folder.corrections_file import corrected
from humanmm.storage.run_folder.run_record import read_run_record
from humanmm.storage.store.codec import Json
from humanmm.storage.store.identity import VideoIdentity, identify
from humanmm.storage.store.open import open_store, open_store_of_run
from humanmm.tasks.engine.plan import Forecast, forecast
from humanmm.tasks.engine.run import VideoRun


def reopen(run_dir: Path, store: Path | None = None) -> tuple[dict[str, Any], VideoRun]:
    """The record of a run folder, and a run of the same video with the same settings and with the corrections that
    the folder holds now. Writes nothing."""
    record = read_run_record(run_dir)
    try:
        video, sha256 = Path(record["video"]["path"]), str(record["video"]["sha256"])
        config = corrected(validate(record["config"], origin=str(run_dir / "run.json")), run_dir, sha256=sha256)
        artifacts = open_store(store, read_only=True) if store else open_store_of_run(record["store"])
    except (KeyError, TypeError) as error:
        raise InputError(f"{run_dir / 'run.json'} lacks {error}; `humanmm recover` writes it anew") from None
    try:
        identity = identify(video, artifacts)
    except VideoError:  # the store finds its artifacts by the hash of its content
        identity = VideoIdentity(video, sha256, None)
    return record, VideoRun(identity, config, artifacts)


def explain(record: Mapping[str, Any], run: VideoRun, stage: str, shot: int | None = None) -> list[dict[str, Json]]:
    """Of each unit of a stage, or of one shot: whether it would run now, how it ran then, and the recipe of its
    artifact."""
    chosen = [entry for entry in forecast(run) if entry.stage == stage and shot in (None, entry.shot)]
    return [_explained(record, run, entry) for entry in chosen]


def _explained(record: Mapping[str, Any], run: VideoRun, entry: Forecast) -> dict[str, Json]:
    unit = (entry.stage, entry.unit)
    then = next((s for s in record["stages"] if (s["stage"], s["unit"]) == unit), None)
    found = next((o for o in run.outcomes.values() if (o.unit.stage.name, o.unit.name) == unit), None)
    manifest = found.manifest if found else None
    return {
        **entry.to_json(),
        "now": entry.sentence,
        "in_this_run": then,
        "artifact": manifest.ref.uri if manifest else None,
        "bytes": manifest.num_bytes if manifest else None,
        "created": manifest.created if manifest else None,
        "recipe": manifest.recipe.to_json() if manifest else None,
    }
