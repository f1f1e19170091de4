"""`humanmm recover VIDEO …`: one video, or several one after the other, end to end."""

import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

import humanmm
from humanmm.cli.settings import Settings
from humanmm.cli.terminal import say, take_back_start, write, write_json, write_path
from humanmm.cli.verb import RECOVERY, STAGES, Json, StageName, Store, app, verb
from humanmm.errors import HumanMMError, InputError, UsageError

if TYPE_CHECKING:
    from humanmm.results import Run
    from humanmm.tasks.engine.plan import Forecast

PARTIAL = 3
_CORRECTIONS = "what you know better (default: corrections.toml in RUN_DIR, see humanmm correct)"
_KEYPOINTS = "keypoints of another program: a folder of OpenPose's, Sports2D's json, MMPose's, COCO's json"
_HMR = "bodies of another system: GVHMR's .pt; experimental: GEM, GEM-X, PromptHMR, WHAM, TRAM, SLAHMR, SAM 3D Body"
_DETECTIONS = "people's boxes of another program: MOT text, COCO results json (experimental)"
_MASKS = "people's masks: a folder of png, one a frame, a pixel's value is the person's number (experimental)"
_CAMERAS = "cameras that are known: a TUM trajectory, a folder of them (.tum, .txt), COLMAP's model, text or binary"
_HANDS = "look at everybody's hands as well, for the joints of the fingers"
_VIDEOS = "a video; several, and all videos of a folder, are recovered one after the other"
_OUT = "default: runs/<name of the video>; of several videos the folder that gets a run folder for each"
_FROM = f"compute STAGE and all after it; stages: {', '.join(STAGES)}"


@verb(app, "recover", panel=RECOVERY)
def recover(  # noqa: PLR0913 (one a flag)
    videos: Annotated[list[Path], Argument(metavar="VIDEO…", help=_VIDEOS, show_default=False)],
    settings: Settings,
    *,
    out: Annotated[Path | None, Option("--out", "-o", metavar="RUN_DIR", help=_OUT)] = None,
    corrections: Annotated[Path | None, Option(metavar="FILE|none", help=_CORRECTIONS)] = None,
    store: Store = None,
    person: Annotated[str | None, Option(metavar="N|all", help="one person, 0 the main one (default: all)")] = None,
    min_confidence: Annotated[float | None, Option(metavar="P", help="least probability of being a person")] = None,
    focal_px: Annotated[float | None, Option(metavar="F", help="focal length in pixels of the video")] = None,
    fov_deg: Annotated[float | None, Option(metavar="D", help="horizontal field of view in degrees")] = None,
    hands: Annotated[bool, Option("--hands", help=_HANDS)] = False,
    hmr_from: Annotated[Path | None, Option(metavar="PATH", help=_HMR)] = None,
    keypoints_from: Annotated[Path | None, Option(metavar="PATH", help=_KEYPOINTS)] = None,
    detections_from: Annotated[Path | None, Option(metavar="FILE", help=_DETECTIONS)] = None,
    masks_from: Annotated[Path | None, Option(metavar="DIR", help=_MASKS)] = None,
    cameras_from: Annotated[Path | None, Option(metavar="PATH", help=_CAMERAS)] = None,
    dry_run: Annotated[bool, Option("--dry-run", help="list what would run and why; write nothing")] = False,
    json: Json = False,
    force: Annotated[bool, Option("--force", help="compute every stage again")] = False,
    start: Annotated[StageName | None, Option("--from", metavar="STAGE", help=_FROM)] = None,
    only: Annotated[StageName | None, Option(metavar="STAGE", help="compute STAGE and what its change affects")] = None,
    shot: Annotated[int | None, Option(metavar="N", help="restrict --from or --only to one shot, 0-based")] = None,
) -> int:
    """Recover people and cameras from a video, or from several one after the other.

    Run it again to go on where it was stopped. Exit status: 0 done, 1 an error, 2 a wrong flag, 3 partial, 130 stopped.
    """
    if json and not dry_run:
        raise UsageError("--json goes with --dry-run")
    if focal_px is not None and fov_deg is not None:
        raise UsageError("--focal-px and --fov-deg exclude each other")
    given: dict[str, float | Path | bool | None] = {
        "min_confidence": min_confidence, "focal_px": focal_px, "fov_deg": fov_deg, "hands": hands or None,
        "hmr_from": hmr_from, "keypoints_from": keypoints_from, "detections_from": detections_from,
        "masks_from": masks_from, "cameras_from": cameras_from,
    }  # fmt: skip
    config = settings.config(**_shorthands(person, **given))
    wanted: dict[str, Any] = {"store": store, "force": force, "start": start, "only": only, "shot": shot}
    wanted["corrections"] = corrections
    jobs = _jobs(videos, out, store, read_only=dry_run)
    if dry_run:
        plans = _forecast_each(jobs, lambda video, folder: humanmm.forecast(video, folder, config=config, **wanted))
        return _write_plans([video for video, _ in jobs], plans, as_json=json)
    take_back_start()
    if len(jobs) == 1:
        ((video, folder),) = jobs
        return report(humanmm.recover(video, folder, config=config, **wanted), store)
    return _recover_each(jobs, lambda video, folder: humanmm.recover(video, folder, config=config, **wanted))


def _jobs(
    videos: Sequence[Path], out: Path | None, store: Path | None, *, read_only: bool
) -> list[tuple[Path, Path | None]]:
    """Each video once, folders opened, with its run folder; None: the default one. InputError names an empty folder."""
    from humanmm.storage.batches.manifest import SUFFIXES, videos_in

    found: dict[Path, Path] = {}
    for path in videos:
        inside = [Path(os.path.relpath(entry.video)) for entry in videos_in(path)] if path.is_dir() else [path]
        if not inside:
            raise InputError(f"{path} is a folder without a video; videos end in {', '.join(sorted(SUFFIXES))}")
        for video in inside:
            found.setdefault(video.absolute(), video)
    if len(found) == 1 and not videos[0].is_dir():
        return [(video, out) for video in found.values()]
    from humanmm.tasks.units.process import prepare_process

    prepare_process()  # before numpy is loaded
    from humanmm.storage.store.open import open_store
    from humanmm.tasks.engine.run_folders import RunFolders

    folders = RunFolders(out or Path("runs"), open_store(store, read_only=read_only))
    return [(video, folders.of(video)) for video in found.values()]


def _forecast_each(
    jobs: Sequence[tuple[Path, Path | None]], forecast: "Callable[[Path, Path | None], list[Forecast]]"
) -> "list[list[Forecast] | HumanMMError]":
    """What would run; of several videos one that has an error has that in place of its plan."""
    if len(jobs) == 1:
        return [forecast(*jobs[0])]
    plans: list[list[Forecast] | HumanMMError] = []
    for video, folder in jobs:
        try:
            plans.append(forecast(video, folder))
        except HumanMMError as error:
            plans.append(error)
    return plans


def _write_plans(videos: Sequence[Path], plans: "Sequence[list[Forecast] | HumanMMError]", *, as_json: bool) -> int:
    """Write what would run; the videos are named where there are several. Exit status 1 if one of them has an error."""
    status = 1 if any(isinstance(plan, HumanMMError) for plan in plans) else 0
    if as_json:
        trees = [_tree(plan) for plan in plans]
        named = [{"video": str(video), **tree} for video, tree in zip(videos, trees, strict=True)]
        write_json(trees[0] if len(trees) == 1 else {"videos": named})
        return status
    for video, plan in zip(videos, plans, strict=True):
        title = [f"{video}:"] if len(plans) > 1 else []
        write(*title, *_lines(plan))
    return status


def _tree(plan: "list[Forecast] | HumanMMError") -> dict[str, Any]:
    if isinstance(plan, HumanMMError):
        return {"error": str(plan)}
    return {"stages": [entry.to_json() for entry in plan]}


def _lines(plan: "list[Forecast] | HumanMMError") -> list[str]:
    if isinstance(plan, HumanMMError):
        return [f"error: {plan}"]
    width = max(len(entry.stage) for entry in plan)
    return [f"{entry.stage:<{width}}  {entry.unit:<11}  {entry.sentence}" for entry in plan]


def _recover_each(jobs: Sequence[tuple[Path, Path | None]], recovered: "Callable[[Path, Path | None], Run]") -> int:
    """One video after the other, a line each; an error of one does not end the others. The gravest exit status."""
    from humanmm.storage.run_folder.summary import one_line

    statuses = [0]
    for number, (video, folder) in enumerate(jobs, start=1):
        place = f"{number} of {len(jobs)}, {video}"
        try:
            run = recovered(video, folder)
        except HumanMMError as error:
            say(f"{place}: {error}")
            statuses.append(1)
            continue
        say(f"{place}: {one_line(run.record)}")
        write_path(run.folder)
        statuses.append(PARTIAL if run.state == "partial" else 0)
    return 1 if 1 in statuses else max(statuses)


def report(run: "Run", store: Path | None) -> int:
    """Say how it went, in five lines on a terminal and in one elsewhere; exit status.

    Where standard output is no terminal it gets the path of the result, alone.
    """
    if not run.folder.exists():  # `--only` changed nothing, and nobody wants a folder
        from humanmm.storage.store.open import open_store

        write(open_store(store).location)
        return 0
    from humanmm.storage.run_folder.summary import five_lines

    _say_corrections(run)
    if run.origin == "unchanged":
        say(f"{run.folder} is up to date: all {len(run.record['stages'])} results were in the store")
    elif run.origin == "restored":
        say(f"{run.folder} written from the store: nothing had to be computed")
    lines = five_lines(run.record, run.folder)
    if sys.stdout.isatty():
        write(*lines)
    elif sys.stderr.isatty():
        for line in lines[:-1]:
            say(line)
        write_path(run.folder)
    else:
        _say_in_one_line(run)
        write_path(run.folder)
    return PARTIAL if run.origin == "computed" and run.state == "partial" else 0


def _say_corrections(run: "Run") -> None:
    """What became of what the user knows better, where there is something to say."""
    for number, one in enumerate(run.corrections, start=1):
        if not one.applied:
            say(f"warning: correction {number} does not fit ({one.text}): {one.reason}")
        elif one.reason:
            say(f"correction {number} ({one.text}): {one.reason}")


def _say_in_one_line(run: "Run") -> None:
    """What failed, or what to look at; nothing where nothing is doubtful."""
    if run.origin != "computed":
        return  # said already
    from humanmm.storage.run_folder.summary import one_line

    if run.state == "partial":
        say("; ".join(map(str, run.failures)))
    elif warnings := [one for one in run.warnings if not one.startswith("correction ")]:  # said above
        more = len(warnings) - 1
        rest = f" (and {more} more, see {run.folder / 'run.json'})" if more else ""
        say(f"{one_line(run.record)}: {warnings[0]}{rest}")


def _shorthands(person: str | None, **given: float | Path | bool | None) -> dict[str, Any]:
    shorthands: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    if person is not None:
        if person != "all" and not person.removeprefix("-").isdecimal():
            raise UsageError(f"--person {person}: neither a number nor `all`")
        shorthands["person"] = None if person == "all" else int(person)
    return shorthands
