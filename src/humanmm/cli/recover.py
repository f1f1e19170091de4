"""`humanmm recover VIDEO`: one video, end to end."""

import argparse
import json
import logging
import os
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from humanmm.cli.progress import Display
from humanmm.cli.settings import UsageError, add_settings, load_config
from humanmm.config import Config
from humanmm.errors import InputError, StoreError
from humanmm.logs import kept_text
from humanmm.storage.run_folder.run_record import read_run_record
from humanmm.storage.store.identity import identify
from humanmm.storage.store.open import open_store
from humanmm.storage.store.store import default_store
from humanmm.tasks import pipeline
from humanmm.tasks.engine import finish
from humanmm.tasks.engine.plan import Forecast, check_upstream, forecast, is_complete
from humanmm.tasks.engine.run import VideoRun
from humanmm.tasks.engine.selection import Selection

if TYPE_CHECKING:
    from prefect.client.schemas.objects import State

log = logging.getLogger(__name__)
PARTIAL = 3
SHOWN_WARNINGS = 3


def add_recover(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Declare the verb and its flags."""
    names = [stage.name for stage in pipeline.STAGES]
    parser = verbs.add_parser(
        "recover", parents=[common], allow_abbrev=False, help="recover people and cameras from one video",
        description=f"Recover people and cameras from one video. Stages: {', '.join(names)}.",
    )  # fmt: skip
    parser.add_argument("video", type=Path)
    parser.add_argument("--out", type=Path, metavar="RUN_DIR", help="run folder (default: runs/<name of the video>)")
    place = "artifact store (default: $HUMANMM_STORE, ~/.cache/humanmm/store)"
    parser.add_argument("--store", type=Path, metavar="DIR|s3://…", help=place)
    parser.add_argument("--person", type=_person, metavar="N|all", help="one person, 0 the main one (default: all)")
    focal = parser.add_mutually_exclusive_group()
    focal.add_argument("--focal-px", type=float, metavar="F", help="focal length in pixels of the source picture")
    focal.add_argument("--fov-deg", type=float, metavar="D", help="horizontal field of view in degrees")
    parser.add_argument("--dry-run", action="store_true", help="list what would run and why; write nothing")
    parser.add_argument("--json", action="store_true", help="with --dry-run: one json object")
    parser.add_argument("--force", action="store_true", help="compute every stage again")
    parser.add_argument("--from", dest="start", choices=names, metavar="STAGE", help="compute STAGE and all after it")
    parser.add_argument("--only", choices=names, metavar="STAGE", help="compute STAGE, then what its change affects")
    parser.add_argument("--shot", type=int, metavar="N", help="restrict --from or --only to one shot, 0-based")
    add_settings(parser)
    parser.set_defaults(run=run)


VERBS = (add_recover,)


def run(options: argparse.Namespace) -> int:
    """Answer from the store if possible, else start the flow."""
    begun = time.time()
    if options.json and not options.dry_run:
        raise UsageError("--json goes with --dry-run")
    config = load_config(options, _shorthands(options))
    selection = _selection(options)
    store = open_store(options.store or default_store(), read_only=options.dry_run)
    video = identify(options.video, store)
    look = VideoRun(video, config, store, selection=selection)
    plan = forecast(look)
    if options.dry_run:
        return _show_plan(plan, as_json=options.json)
    if selection.only is not None:
        check_upstream(look, plan, selection.only)
    run_dir = options.out or finish.default_run_dir(video.path)
    check_writable(run_dir)
    if is_complete(plan):
        return _answer_from_store(look, run_dir, begun)
    return _run_flow(options.video, run_dir, config, store.place, selection)


def _answer_from_store(look: VideoRun, run_dir: Path, begun: float) -> int:
    if finish.is_up_to_date(look, run_dir):
        log.info("nothing to do")
        _say(f"{run_dir} is up to date: all {len(look.outcomes)} results were in the store")
    else:
        finish.write_results(look, run_dir, started=begun, log_text=f"{_now()} written from the store alone\n")
        _say(f"{run_dir} written from the store: nothing had to be computed")
    return _result(run_dir, 0)


def _run_flow(video: Path, run_dir: Path, config: Config, store: str, selection: Selection) -> int:
    from humanmm.flows.server.local_server import prefect_server

    text = kept_text()
    with Display() as display, prefect_server():
        from humanmm.flows import recover as flow_module

        watched: list[VideoRun] = []

        def watch(run: VideoRun) -> None:
            watched.append(run)
            run.watch(display.progress, log_text=text.getvalue)

        token = flow_module.opened.set(watch)
        try:
            asked = {"out": run_dir, "config": config, "store": store, "selection": selection}
            state = cast("State[Any]", flow_module.recover(video, **asked, return_state=True))
        finally:
            flow_module.opened.reset(token)
    if state.name == "Partial":
        for outcome in finish.failures(watched[0]):
            _say(f"{outcome.work.label} failed: {outcome.reason}")
        return _result(run_dir, PARTIAL)
    if not state.is_completed():
        error = state.result(raise_on_failure=False)
        told = StoreError(f"the flow ended as {state.name}: {state.message}")
        raise error if isinstance(error, BaseException) else told
    for sentence in _warnings(run_dir):
        _say(sentence)
    return _result(run_dir if run_dir.exists() else Path(store), 0)


def _warnings(run_dir: Path) -> list[str]:
    """The first warnings of a finished run, and how many more there are."""
    if not run_dir.exists():
        return []
    warnings: list[str] = read_run_record(run_dir)["warnings"]
    more = len(warnings) - SHOWN_WARNINGS
    rest = [f"and {more} more warnings, see {run_dir / 'run.json'}"] if more > 0 else []
    return [f"warning: {warning}" for warning in warnings[:SHOWN_WARNINGS]] + rest


def check_writable(run_dir: Path) -> None:
    """Refuse an output folder that cannot be written before anything is computed."""
    existing = run_dir.absolute()
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    if not existing.is_dir():
        raise InputError(f"the output folder {run_dir} cannot be made: {existing} is a file")
    if not os.access(existing, os.W_OK | os.X_OK):
        raise InputError(f"the output folder {run_dir} is not writable: permission denied for {existing}")


def _selection(options: argparse.Namespace) -> Selection:
    selection = Selection(force=options.force, start=options.start, only=options.only, shot=options.shot)
    try:
        for remark in selection.check(pipeline.STAGES):
            _say(remark)
    except InputError as error:
        raise UsageError(str(error)) from None
    return selection


def _shorthands(options: argparse.Namespace) -> dict[str, Any]:
    given = {"intrinsics.focal_px": options.focal_px, "intrinsics.fov_deg": options.fov_deg}
    shorthands = {name: value for name, value in given.items() if value is not None}
    if options.person is not None:
        shorthands["shots.person"] = None if options.person == "all" else options.person
    return shorthands


def _person(text: str) -> int | str:
    if text == "all":
        return text
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is neither a number nor `all`") from None


def _show_plan(plan: list[Forecast], *, as_json: bool) -> int:
    if as_json:
        sys.stdout.write(json.dumps({"stages": [entry.to_json() for entry in plan]}, indent=1) + "\n")
        return 0
    width = max(len(entry.stage) for entry in plan)
    for entry in plan:
        sys.stdout.write(f"{entry.stage:<{width}}  {entry.unit:<11}  {entry.sentence}\n")
    return 0


def _result(path: Path, status: int) -> int:
    sys.stdout.flush()
    sys.stdout.buffer.write(os.fsencode(path) + b"\n")
    sys.stdout.buffer.flush()
    return status


def _say(text: str) -> None:
    sys.stderr.write(f"humanmm: {' '.join(text.split()).encode('utf-8', 'backslashreplace').decode()}\n")


def _now() -> str:
    return time.strftime("%Y-%m-%d %H:%M:%S")
