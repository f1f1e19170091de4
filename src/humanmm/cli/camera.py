"""`humanmm camera VIDEO`: the cameras of a video's shots, people or none."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from humanmm.cli.settings import Settings
from humanmm.cli.terminal import say, take_back_start, write_path
from humanmm.cli.verb import RECOVERY, Force, Store, app, verb
from humanmm.errors import UsageError

_OUT = "the folder that is written (default: runs/<name of the video>-camera)"
_CAMERAS = "cameras that are known: a TUM trajectory, a folder of them (.tum, .txt), COLMAP's model, text or binary"


@verb(app, "camera", panel=RECOVERY)
def camera(
    video: Annotated[Path, Argument(metavar="VIDEO", help="a video", show_default=False)],
    settings: Settings,
    *,
    out: Annotated[Path | None, Option("--out", "-o", metavar="DIR", help=_OUT)] = None,
    store: Store = None,
    focal_px: Annotated[float | None, Option(metavar="F", help="focal length in pixels of the video")] = None,
    fov_deg: Annotated[float | None, Option(metavar="D", help="horizontal field of view in degrees")] = None,
    cameras_from: Annotated[Path | None, Option(metavar="PATH", help=_CAMERAS)] = None,
    force: Force = False,
) -> None:
    """Recover the camera of every shot alone, also of a video with nobody in it; what the store has is used.

    Each shot is in the axes of its own first camera, and the path of one that moves has no unit: what tells metres and
    joins shots are people (humanmm recover).
    """
    if focal_px is not None and fov_deg is not None:
        raise UsageError("--focal-px and --fov-deg exclude each other")
    from humanmm.progress import watching
    from humanmm.storage.run_folder.camera_folder import check_camera_folder, write_camera_folder
    from humanmm.storage.run_folder.summary import counted
    from humanmm.tasks.engine.finish import default_run_dir

    plain = default_run_dir(video)
    folder = out or plain.with_name(f"{plain.name}-camera")
    check_camera_folder(folder, force=force)
    given = {"focal_px": focal_px, "fov_deg": fov_deg, "cameras_from": cameras_from}
    named = {name: value for name, value in given.items() if value is not None}
    config = settings.config(**named, **{"shots.need_people": False})
    take_back_start()
    with watching(video.name) as watch:
        watch.step("reading the video")
        from humanmm.storage.store.open import open_store
        from humanmm.tasks.engine.cameras import recover_cameras

        found = recover_cameras(video, config, open_store(store), follow=watch.follow)
    write_camera_folder(folder, found.facts, found.shots, found.intrinsics, found.cameras, force=force)
    told = [f"shot {number}: {one.source}" for number, one in enumerate(found.cameras)]
    shots, focal = counted(len(told), "shot", "shots"), found.intrinsics
    say(f"done: {shots}, focal length {focal.focal_px:.0f} px ({focal.source})")
    for line in (*told, *found.warnings):
        say(f"  {line}")
    write_path(folder)
