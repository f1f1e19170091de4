"""`humanmm status` and `humanmm explain`: what is stale, why, and what a result was made of."""

import argparse
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from humanmm.cli.settings import UsageError
from humanmm.config_reading import validate
from humanmm.errors import InputError, VideoError
from humanmm.storage.run_folder.run_record import read_run_record
from humanmm.storage.store.identity import VideoIdentity, identify
from humanmm.storage.store.open import open_store
from humanmm.storage.store.store import default_store
from humanmm.tasks import pipeline
from humanmm.tasks.engine.finish import is_up_to_date
from humanmm.tasks.engine.plan import Forecast, forecast
from humanmm.tasks.engine.run import VideoRun


def add_status(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Declare `status [RUN_DIR]`."""
    parser = verbs.add_parser(
        "status", parents=[common], allow_abbrev=False, help="what of a run is stale, and why; or all videos of a store"
    )
    parser.add_argument("run_dir", type=Path, nargs="?", metavar="RUN_DIR")
    parser.add_argument("--store", type=Path, metavar="DIR|s3://…")
    parser.add_argument("--json", action="store_true", help="one json object")
    parser.set_defaults(run=status)


def add_explain(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Declare `explain RUN_DIR STAGE`."""
    parser = verbs.add_parser(
        "explain", parents=[common], allow_abbrev=False, help="what a stage's result was made of, and why it would run"
    )
    parser.add_argument("run_dir", type=Path, metavar="RUN_DIR")
    parser.add_argument("stage", choices=[stage.name for stage in pipeline.STAGES], metavar="STAGE")
    parser.add_argument("--shot", type=int, metavar="N", help="one shot, 0-based")
    parser.add_argument("--store", type=Path, metavar="DIR|s3://…")
    parser.add_argument("--json", action="store_true", help="one json object")
    parser.set_defaults(run=explain)


VERBS = (add_status, add_explain)


def status(options: argparse.Namespace) -> int:
    """What of a run is stale; without a run folder, the videos that the store knows."""
    if options.run_dir is None:
        return _store_status(options)
    record, run = _reopen(options)
    plan = forecast(run)
    stale = [entry for entry in plan if entry.state != "cached"]
    fresh = not stale and is_up_to_date(run, options.run_dir)
    if options.json:
        tree = {
            "run_dir": str(options.run_dir),
            "state": record["state"],
            "up_to_date": fresh,
            "failures": record["failures"],
            "warnings": record["warnings"],
            "stages": [entry.to_json() for entry in plan],
        }
        return _print_json(tree)
    frames, shots = record["video"]["num_frames"], len(record["shots"])
    lines = [f"{options.run_dir}: {record['state']}, {frames} frames, {shots} shots"]
    lines += [f"  failed: {f['stage']} ({f['unit']}): {f['reason']}" for f in record["failures"]]
    lines += [f"  warning: {warning}" for warning in record["warnings"]]
    if stale:
        lines += [f"  {entry.stage} ({entry.unit}): {entry.sentence}" for entry in stale]
    else:
        lines.append("  up to date" if fresh else "  the store has every result; `humanmm recover` rewrites the folder")
    return _print(lines)


def explain(options: argparse.Namespace) -> int:
    """The recipe of one stage's result, and its state today."""
    record, run = _reopen(options)
    if options.shot is not None and run.stage(options.stage).per != "shot":
        raise UsageError(f"{options.stage} is not computed per shot; leave --shot out")
    plan = forecast(run)
    chosen = [entry for entry in plan if entry.stage == options.stage and options.shot in (None, entry.shot)]
    if not chosen:
        raise InputError(f"--shot {options.shot}: the video has {len(record['shots'])} shots")
    entries = [_explained(record, run, entry) for entry in chosen]
    if options.json:
        return _print_json({"run_dir": str(options.run_dir), "stage": options.stage, "units": entries})
    return _print([line for entry in entries for line in _lines(entry)])


def _explained(record: Mapping[str, Any], run: VideoRun, entry: Forecast) -> dict[str, Any]:
    place = (entry.stage, entry.unit)
    then = next((s for s in record["stages"] if (s["stage"], s["unit"]) == place), None)
    found = next((o for o in run.outcomes.values() if (o.work.stage.name, o.work.unit) == place), None)
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


def _lines(entry: Mapping[str, Any]) -> list[str]:
    lines = [f"{entry['stage']} ({entry['unit']}): {entry['now']}"]
    then, recipe = entry["in_this_run"], entry["recipe"]
    if then:
        attempts = f", {then['attempts']} attempts" if then["attempts"] > 1 else ""
        reason = f" ({then['reason']})" if then["reason"] else ""
        lines.append(f"  in this run: {then['state']}{reason}, {then['seconds']:.1f} s{attempts}")
        lines += [f"  attempt failed: {fault}" for fault in then["faults"]]
        lines += [f"  warning: {warning}" for warning in then["warnings"]]
    if recipe:
        lines.append(f"  artifact: {entry['artifact']}, {entry['bytes'] / 1e6:.2f} MB, {entry['created']}")
        for title in ("unit", "settings", "inputs", "weights", "libraries", "modules"):
            for name, value in recipe[title].items():
                lines.append(f"  {title}: {name} = {value[:12] if title in _DIGESTS else value}")
    return lines


_DIGESTS = ("inputs", "weights", "modules")


def _reopen(options: argparse.Namespace) -> tuple[dict[str, Any], VideoRun]:
    """The record of a run folder, and the same run as it would be today. Writes nothing."""
    record = read_run_record(options.run_dir)
    try:
        config = validate(record["config"], origin=str(options.run_dir / "run.json"))
        store = open_store(options.store or Path(record["store"]), read_only=True)
        video = Path(record["video"]["path"])
        sha256 = str(record["video"]["sha256"])
    except (KeyError, TypeError) as error:
        raise InputError(f"{options.run_dir / 'run.json'} lacks {error}; `humanmm recover` writes it anew") from None
    try:
        identity = identify(video, store)
    except VideoError:  # the store still knows it by its content
        identity = VideoIdentity(video, sha256, 0, 0, 0)
    return record, VideoRun(identity, config, store)


def _store_status(options: argparse.Namespace) -> int:
    from humanmm.storage.store.maintenance import known_runs

    store = open_store(options.store or default_store(), read_only=True)
    runs = known_runs(store)
    if options.json:
        told = ("video", "state", "run_dir", "reason", "finished")
        videos = [{name: getattr(run, name) for name in told} for run in runs]
        return _print_json({"store": store.place, "videos": videos})
    lines = [f"store {store.place}: {len(runs)} videos"]
    lines += [f"  {run.video[:12]}  {run.state:<8} {run.run_dir or '-'}  {run.reason}".rstrip() for run in runs]
    return _print(lines)


def _print(lines: list[str]) -> int:
    sys.stdout.write("".join(f"{line.encode('utf-8', 'backslashreplace').decode()}\n" for line in lines))
    return 0


def _print_json(tree: Mapping[str, Any]) -> int:
    sys.stdout.write(json.dumps(tree, indent=1) + "\n")
    return 0
