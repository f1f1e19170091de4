"""`humanmm recover VIDEO`: one video, end to end."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

import humanmm
from humanmm.cli.settings import Settings
from humanmm.cli.terminal import say, write, write_json, write_path
from humanmm.cli.verb import RECOVERY, STAGES, Json, StageName, Store, app, verb
from humanmm.errors import UsageError

if TYPE_CHECKING:
    from humanmm.results import Run

PARTIAL = 3
SHOWN_WARNINGS = 3
_CORRECTIONS = "what you know better (default: corrections.toml in RUN_DIR, see humanmm correct)"
_KEYPOINTS = "keypoints of another program: a folder of OpenPose's, Sports2D's json, MMPose's, COCO's json"
_CAMERAS = "cameras of another program: a TUM trajectory, a folder with COLMAP's cameras.txt and images.txt"
_FROM = f"compute STAGE and all after it; stages: {', '.join(STAGES)}"


@verb(app, "recover", panel=RECOVERY)
def recover(  # noqa: PLR0913 (one a flag)
    video: Annotated[Path, Argument(metavar="VIDEO", show_default=False)],
    settings: Settings,
    *,
    out: Annotated[
        Path | None, Option("--out", "-o", metavar="RUN_DIR", help="default: runs/<name of the video>")
    ] = None,
    corrections: Annotated[Path | None, Option(metavar="FILE|none", help=_CORRECTIONS)] = None,
    store: Store = None,
    person: Annotated[str | None, Option(metavar="N|all", help="one person, 0 the main one (default: all)")] = None,
    min_confidence: Annotated[float | None, Option(metavar="P", help="least probability of being a person")] = None,
    focal_px: Annotated[float | None, Option(metavar="F", help="focal length in pixels of the video")] = None,
    fov_deg: Annotated[float | None, Option(metavar="D", help="horizontal field of view in degrees")] = None,
    keypoints_from: Annotated[Path | None, Option(metavar="PATH", help=_KEYPOINTS)] = None,
    cameras_from: Annotated[Path | None, Option(metavar="PATH", help=_CAMERAS)] = None,
    dry_run: Annotated[bool, Option("--dry-run", help="list what would run and why; write nothing")] = False,
    json: Json = False,
    force: Annotated[bool, Option("--force", help="compute every stage again")] = False,
    start: Annotated[StageName | None, Option("--from", metavar="STAGE", help=_FROM)] = None,
    only: Annotated[StageName | None, Option(metavar="STAGE", help="compute STAGE and what its change affects")] = None,
    shot: Annotated[int | None, Option(metavar="N", help="restrict --from or --only to one shot, 0-based")] = None,
) -> int:
    """Recover people and cameras from one video."""
    if json and not dry_run:
        raise UsageError("--json goes with --dry-run")
    if focal_px is not None and fov_deg is not None:
        raise UsageError("--focal-px and --fov-deg exclude each other")
    given = {"focal_px": focal_px, "fov_deg": fov_deg, "keypoints_from": keypoints_from, "cameras_from": cameras_from}
    config = settings.config(**_shorthands(person, min_confidence=min_confidence, **given))
    wanted: dict[str, Any] = {"store": store, "force": force, "start": start, "only": only, "shot": shot}
    wanted["corrections"] = corrections
    if dry_run:
        plan = humanmm.forecast(video, out, config=config, **wanted)
        if json:
            write_json({"stages": [entry.to_json() for entry in plan]})
        else:
            width = max(len(entry.stage) for entry in plan)
            write(*(f"{entry.stage:<{width}}  {entry.unit:<11}  {entry.sentence}" for entry in plan))
        return 0
    return report(humanmm.recover(video, out, config=config, **wanted), store)


def report(run: "Run", store: Path | None) -> int:
    """Say how it went; the path of the result; exit status."""
    corrections = run.corrections if run.folder.exists() else ()
    for number, one in enumerate(corrections, start=1):
        if not one.applied:
            say(f"warning: correction {number} does not fit ({one.text}): {one.reason}")
        elif one.reason:
            say(f"correction {number} ({one.text}): {one.reason}")
    if run.origin == "unchanged":
        say(f"{run.folder} is up to date: all {len(run.record['stages'])} results were in the store")
    elif run.origin == "restored":
        say(f"{run.folder} written from the store: nothing had to be computed")
    elif not run.folder.exists():  # `--only` changed nothing, and nobody wants a folder
        from humanmm.storage.store.open import open_store

        write(open_store(store).location)
        return 0
    elif run.state == "partial":
        for failure in run.failures:
            say(str(failure))
    else:
        warnings = [warning for warning in run.warnings if not warning.startswith("correction ")]  # told above
        for warning in warnings[:SHOWN_WARNINGS]:
            say(f"warning: {warning}")
        more = len(warnings) - SHOWN_WARNINGS
        if more > 0:
            say(f"and {more} more warnings, see {run.folder / 'run.json'}")
    write_path(run.folder)
    return PARTIAL if run.origin == "computed" and run.state == "partial" else 0


def _shorthands(person: str | None, **given: float | Path | None) -> dict[str, Any]:
    shorthands: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    if person is not None:
        if person != "all" and not person.removeprefix("-").isdecimal():
            raise UsageError(f"--person {person}: neither a number nor `all`")
        shorthands["person"] = None if person == "all" else int(person)
    return shorthands
