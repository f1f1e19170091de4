"""Recover one video: answer from the store if nothing changed, else run the Prefect flow.

The command line and Python programs call the same two functions, `recover` and `forecast`.
"""

import asyncio
import contextlib
import logging
import os
import sys
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from humanmm.errors import ResourceError, StoreError
from humanmm.results import Run

if TYPE_CHECKING:
    from prefect.client.schemas.objects import State

    from humanmm.config import Config
    from humanmm.corrections import Corrections
    from humanmm.progress import Watch
    from humanmm.tasks.engine.plan import Forecast
    from humanmm.tasks.engine.run import VideoRun
    from humanmm.tasks.units.selection import Selection

log = logging.getLogger(__name__)


def recover(  # noqa: PLR0913 (the flags of the command, as keywords)
    video: "str | os.PathLike[str]",
    out: "str | os.PathLike[str] | None" = None,
    *,
    config: "Config | Mapping[str, Any] | str | os.PathLike[str] | None" = None,
    person: int | None = None,
    focal_px: float | None = None,
    fov_deg: float | None = None,
    hands: bool | None = None,
    corrections: "Corrections | Mapping[str, Any] | str | os.PathLike[str] | None" = None,
    hmr_from: "str | os.PathLike[str] | None" = None,
    keypoints_from: "str | os.PathLike[str] | None" = None,
    detections_from: "str | os.PathLike[str] | None" = None,
    masks_from: "str | os.PathLike[str] | None" = None,
    cameras_from: "str | os.PathLike[str] | None" = None,
    store: "str | os.PathLike[str] | None" = None,
    force: bool = False,
    start: str | None = None,
    only: str | None = None,
    shot: int | None = None,
    progress: bool = True,
) -> Run:
    """Recover the people and the cameras of one video, and write the run folder.

    What the store holds is not computed again: a second call with the same arguments takes about a second. If a stage
    failed on some shots, the run's `state` is "partial" and its `failures` say why.

    Args:
        video: the video file.
        out: the run folder (default: runs/<name of the video>, with 8 digits of its content if another video has that).
        config: settings, as a Config, a tree such as {"camera": {"static": True}}, or the path of a TOML file.
        person: keep this person alone, 0 is the main one (default: all, or as `config` says).
        focal_px: focal length in pixels of the source video; it is then not estimated.
        fov_deg: horizontal field of view in degrees, in place of `focal_px`.
        hands: look at everybody's hands as well, for the joints of the fingers (docs/hands.md).
        corrections: what you know better (docs/correct.md), as Corrections, a tree, or the path of a TOML file
            (default: `corrections.toml` in the run folder, if there is one).
        hmr_from: file or folder of bodies that another system found, which are then joined and refined (docs/bring.md).
        keypoints_from: file or folder of keypoints that another program found; nobody is then looked for.
        detections_from: file of people's boxes; our pose network looks there alone.
        masks_from: folder of people's masks; the same.
        cameras_from: TUM trajectory or COLMAP's model; these cameras are then not estimated.
        store: artifact store, a folder or s3://… (default: $HUMANMM_STORE, ~/.cache/humanmm/store).
        force: compute every stage again.
        start: compute this stage and all after it again.
        only: compute this stage again, then what depends on it if its result changed.
        shot: restrict `start` or `only` to this shot.
        progress: show bars on a terminal or in a notebook.

    Raises:
        HumanMMError: see humanmm.errors; NoUsablePersonError if nobody can be recovered.
        KeyboardInterrupt: at Ctrl-C or a signal, which the message names.
    """
    from humanmm.progress import watching

    shorthands = {
        "person": person, "focal_px": focal_px, "fov_deg": fov_deg, "hands": hands,
        "hmr_from": hmr_from, "keypoints_from": keypoints_from, "detections_from": detections_from,
        "masks_from": masks_from, "cameras_from": cameras_from,
    }  # fmt: skip
    selection = _selection(force=force, start=start, only=only, shot=shot)
    with watching(Path(video).name, shown=progress) as watch:
        return _recover(video, out, config, shorthands, corrections, store, selection, watch)


def _recover(
    video: "str | os.PathLike[str]",
    out: "str | os.PathLike[str] | None",
    config: "Config | Mapping[str, Any] | str | os.PathLike[str] | None",
    shorthands: Mapping[str, Any],
    corrections: "Corrections | Mapping[str, Any] | str | os.PathLike[str] | None",
    store: "str | os.PathLike[str] | None",
    selection: "Selection",
    watch: "Watch",
) -> Run:
    began = time.time()
    watch.step("reading the video")
    folder, run = _open(video, out, _settings(config, shorthands, corrections), selection, store)
    watch.step("looking into the store")
    from humanmm.storage.store.files import check_writable
    from humanmm.tasks.engine import finish
    from humanmm.tasks.engine.plan import check_upstream, forecast, is_complete

    plan = forecast(run)
    if selection.only is not None:
        check_upstream(run, plan, selection.only)
    check_writable(folder)
    if not is_complete(plan):
        _run_flow(run, folder, watch)
        return Run(folder, "computed")
    if finish.is_up_to_date(run, folder):
        log.info("nothing to do")
        return Run(folder, "unchanged")
    stamp = time.strftime("%Y-%m-%d %H:%M:%S")
    finish.write_results(run, folder, started=began, log_text=f"{stamp} written from the store alone\n")
    return Run(folder, "restored")


def forecast(  # noqa: PLR0913 (as `recover`)
    video: "str | os.PathLike[str]",
    out: "str | os.PathLike[str] | None" = None,
    *,
    config: "Config | Mapping[str, Any] | str | os.PathLike[str] | None" = None,
    person: int | None = None,
    focal_px: float | None = None,
    fov_deg: float | None = None,
    hands: bool | None = None,
    corrections: "Corrections | Mapping[str, Any] | str | os.PathLike[str] | None" = None,
    hmr_from: "str | os.PathLike[str] | None" = None,
    keypoints_from: "str | os.PathLike[str] | None" = None,
    detections_from: "str | os.PathLike[str] | None" = None,
    masks_from: "str | os.PathLike[str] | None" = None,
    cameras_from: "str | os.PathLike[str] | None" = None,
    store: "str | os.PathLike[str] | None" = None,
    force: bool = False,
    start: str | None = None,
    only: str | None = None,
    shot: int | None = None,
) -> "list[Forecast]":
    """What `recover` would do with the same arguments: each stage on each scene or shot is cached, will run, or waits.

    Writes nothing.
    """
    from humanmm.tasks.engine.plan import forecast as forecast_run

    shorthands = {
        "person": person, "focal_px": focal_px, "fov_deg": fov_deg, "hands": hands,
        "hmr_from": hmr_from, "keypoints_from": keypoints_from, "detections_from": detections_from,
        "masks_from": masks_from, "cameras_from": cameras_from,
    }  # fmt: skip
    selection = _selection(force=force, start=start, only=only, shot=shot)
    settings = _settings(config, shorthands, corrections)
    return forecast_run(_open(video, out, settings, selection, store, read_only=True)[1])


def _settings(
    config: "Config | Mapping[str, Any] | str | os.PathLike[str] | None",
    shorthands: Mapping[str, Any],
    corrections: "Corrections | Mapping[str, Any] | str | os.PathLike[str] | None",
) -> "Config":
    """The configuration with the corrections that are given."""
    from humanmm.tasks.units.process import prepare_process

    prepare_process()  # before numpy is loaded
    from humanmm.config_reading import resolve

    settings = resolve(config, {name: value for name, value in shorthands.items() if value is not None})
    if corrections is None:
        return settings
    return settings.model_copy(update={"corrections": _corrections(corrections)})


def _corrections(given: "Corrections | Mapping[str, Any] | str | os.PathLike[str]") -> "Corrections":
    from humanmm.corrections import NONE, Corrections, read_corrections
    from humanmm.storage.run_folder.corrections_file import read_file

    if isinstance(given, Corrections):
        found = given
    elif isinstance(given, Mapping):
        found = read_corrections(given)
    else:
        found = NONE if os.fspath(given) == "none" else read_file(Path(given))
    return found if found.is_decided else NONE


def _selection(**wanted: Any) -> "Selection":
    from humanmm.tasks import pipeline
    from humanmm.tasks.units.selection import Selection

    selection = Selection(**wanted)
    for remark in selection.check(pipeline.STAGES):
        log.warning(remark)
    return selection


def _open(
    video: "str | os.PathLike[str]",
    out: "str | os.PathLike[str] | None",
    config: "Config",
    selection: "Selection",
    store: "str | os.PathLike[str] | None",
    *,
    read_only: bool = False,
) -> "tuple[Path, VideoRun]":
    """The run folder, and the run with the corrections that the folder holds unless the configuration names some."""
    from humanmm.storage.run_folder.corrections_file import decided
    from humanmm.storage.store.identity import identify
    from humanmm.storage.store.open import open_store
    from humanmm.tasks.engine.run import VideoRun
    from humanmm.tasks.engine.run_folders import check_replaceable, run_dir_of

    artifacts = open_store(None if store is None else Path(store), read_only=read_only)
    identity = identify(Path(video), artifacts)
    folder = run_dir_of(identity, None if out is None else Path(out), artifacts)
    check_replaceable(folder, identity.sha256)
    config = decided(config, folder, sha256=identity.sha256)
    found = config.corrections
    if found.correction:
        number = len(found.correction)
        log.warning("%d correction%s of %s", number, "s" if number > 1 else "", found.origin or "the caller")
    return folder, VideoRun(identity, config, artifacts, selection=selection)


def _run_flow(run: "VideoRun", folder: Path, watch: "Watch") -> None:
    """Run the Prefect flow on what `run` names. Raises the error that ended it; a partial result is no error."""
    from humanmm.flows.server.local_server import prefect_server
    from humanmm.logs import keeping_text

    watch.step("starting Prefect's server, if none runs yet")
    with _outside_event_loop(), keeping_text() as text, prefect_server():
        watch.step("loading Prefect")
        if "prefect" in sys.modules:  # it read its settings before the server had an address
            sys.modules["prefect.context"].refresh_global_settings_context()
        from humanmm.flows import recover as flow_module

        def opened(opened_run: "VideoRun") -> None:
            opened_run.log_text = text.getvalue
            watch.follow(opened_run)
            watch.step("loading the stages")

        watch.step("beginning the flow")
        token = flow_module.opened.set(opened)
        try:
            arguments = {"out": folder, "config": run.config, "store": run.store.location, "selection": run.selection}
            state = cast("State[Any]", flow_module.recover(run.video.path, **arguments, return_state=True))
        except Exception as error:
            ours = _of_server(error)
            if ours is error:
                raise
            raise ours from error
        finally:
            flow_module.opened.reset(token)
        if state.is_completed() or state.name == "Partial":
            return
        if state.is_cancelled():
            raise KeyboardInterrupt(state.message)
        raised = state.result(raise_on_failure=False)
    if isinstance(raised, Exception):
        raise _of_server(raised)
    if isinstance(raised, BaseException):
        raise raised
    raise StoreError(f"the flow ended as {state.name}: {state.message}")


def _of_server(error: Exception) -> Exception:
    """An error of Prefect's client in our words: the server is gone, or cannot write; any other as it is."""
    from prefect.exceptions import ObjectNotFound, PrefectHTTPStatusError

    if isinstance(error, ObjectNotFound | PrefectHTTPStatusError):
        what = f"cannot record the run ({type(error).__name__}): the disk of its database may be full; free some space,"
    elif isinstance(error, RuntimeError) and str(error).startswith(
        ("Failed to reach API", "Timed out while attempting to connect")
    ):
        what = "does not respond: it was ended, or this machine is too busy to start one;"
    else:
        return error
    return ResourceError(f"Prefect's server {what} run again, what was computed stays in the store")


@contextlib.contextmanager
def _outside_event_loop() -> Iterator[None]:
    """Hide the event loop that runs in this thread, as in a notebook: Prefect would return coroutines otherwise.

    The flow stays in the caller's thread, so that Ctrl-C and a notebook's interrupt end it.
    """
    loop = asyncio._get_running_loop()
    asyncio._set_running_loop(None)
    try:
        yield
    finally:
        asyncio._set_running_loop(loop)
