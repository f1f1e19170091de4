"""`humanmm status` says which results are stale and why, `humanmm explain` what a result was computed from."""

import contextlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from humanmm.cli.terminal import write_all, write_json
from humanmm.cli.verb import RESULTS, Json, RunDir, StageName, Store, app, verb
from humanmm.errors import InputError, UsageError

if TYPE_CHECKING:
    from humanmm.storage.store.video_records import RunNote


@verb(app, "status", panel=RESULTS)
def status(
    run_dir: Annotated[Path | None, Argument(metavar="RUN_DIR", help="a run folder")] = None,
    *,
    store: Store = None,
    failed: Annotated[bool, Option("--failed", help="without RUN_DIR: only videos that failed or are partial")] = False,
    json: Json = False,
) -> None:
    """Say what of a run is stale, and why; without RUN_DIR, list all videos of the store, the newest first."""
    if run_dir is None:
        return _store_status(store, only_failed=failed, as_json=json)
    if failed:
        raise UsageError("--failed goes without RUN_DIR")
    from humanmm.tasks.engine.finish import is_up_to_date
    from humanmm.tasks.engine.plan import forecast
    from humanmm.tasks.engine.reopened import reopen

    record, run = reopen(run_dir, store)
    plan = forecast(run)
    stale = [entry for entry in plan if entry.state != "cached"]
    fresh = not stale and is_up_to_date(run, run_dir)
    if json:
        tree = {"run_dir": str(run_dir), "state": record["state"], "up_to_date": fresh}
        tree |= {name: record[name] for name in ("failures", "warnings")}
        return write_json({**tree, "stages": [entry.to_json() for entry in plan]})
    frames, shots = record["video"]["num_frames"], len(record["shots"])
    lines = [f"{run_dir}: {record['state']}, {frames} frames, {shots} shots"]
    lines += [f"  failed: {f['stage']} ({f['unit']}): {f['reason']}" for f in record["failures"]]
    lines += [f"  warning: {warning}" for warning in record["warnings"]]
    lines += [f"  {entry.stage} ({entry.unit}): {entry.sentence}" for entry in stale]
    if not stale:
        lines.append("  up to date" if fresh else "  the store has every result; `humanmm recover` rewrites the folder")
    return write_all(lines)


@verb(app, "explain", panel=RESULTS)
def explain(
    run_dir: RunDir,
    stage: Annotated[StageName, Argument(metavar="STAGE", show_default=False)],
    *,
    shot: Annotated[int | None, Option(metavar="N", help="one shot, 0-based")] = None,
    store: Store = None,
    json: Json = False,
) -> None:
    """Say what a stage's result was computed from, and whether it would be computed again."""
    from humanmm.tasks.engine import reopened

    record, run = reopened.reopen(run_dir, store)
    if shot is not None and run.stage(stage).per != "shot":
        raise UsageError(f"{stage} is not computed per shot; leave --shot out")
    entries = reopened.explain(record, run, stage, shot)
    if not entries and shot is not None and shot < len(record["shots"]):
        raise InputError(f"--shot {shot}: the store {run.store.location} does not have the shots of this run")
    if not entries:
        raise InputError(f"--shot {shot}: the video has {len(record['shots'])} shots")
    if json:
        return write_json({"run_dir": str(run_dir), "stage": stage, "units": entries})
    return write_all(line for entry in entries for line in _lines(entry))


def _lines(entry: Mapping[str, Any]) -> Iterator[str]:
    yield f"{entry['stage']} ({entry['unit']}): {entry['now']}"
    then, recipe = entry["in_this_run"], entry["recipe"]
    if then:
        attempts = f", {then['attempts']} attempts" if then["attempts"] > 1 else ""
        reason = f" ({then['reason']})" if then["reason"] else ""
        yield f"  in this run: {then['state']}{reason}, {then['seconds']:.1f} s{attempts}"
        yield from (f"  attempt failed: {fault}" for fault in then["faults"])
        yield from (f"  warning: {warning}" for warning in then["warnings"])
    if recipe:
        yield f"  artifact: {entry['artifact']}, {entry['bytes'] / 1e6:.2f} MB, {entry['created']}"
        for title in ("unit", "settings", "inputs", "weights", "libraries", "modules"):
            for name, value in recipe[title].items():
                yield f"  {title}: {name} = {value[:12] if title in _DIGESTS else value}"


_DIGESTS = ("inputs", "weights", "modules")


def _store_status(location: Path | None, *, only_failed: bool, as_json: bool) -> None:
    from humanmm.storage.store.open import open_store

    store = open_store(location, read_only=True)
    runs = [run for run in store.known_runs() if not only_failed or run.state != "done"]
    if as_json:
        names = ("video", "path", "state", "run_dir", "reason", "finished")
        videos = [{name: getattr(run, name) for name in names} for run in runs]
        return write_json({"store": store.location, "videos": videos})
    width = max((len(Path(run.path).name) for run in runs), default=0)
    lines = (f"  {run.finished[:16]}  {Path(run.path).name:<{width}}  {_ended(run)}" for run in runs)
    return write_all(
        [f"store {store.location}: {len(runs)} videos{' failed or partial' if only_failed else ''}", *lines]
    )


def _ended(run: "RunNote") -> str:
    """How the last run on a video ended, in one line: of its run folder if that is still the one, else as noted."""
    from humanmm.storage.run_folder.run_record import read_run_record
    from humanmm.storage.run_folder.summary import one_line

    with contextlib.suppress(InputError):
        record = read_run_record(Path(run.run_dir)) if run.run_dir else {}
        if record and (record["video"]["sha256"], record["state"]) == (run.video, run.state):
            reason = f": {run.reason}" if run.reason else ""
            return f"{one_line(record)}{reason}  {run.run_dir}"
    return "  ".join(part for part in (run.state, run.reason, run.run_dir) if part)
