"""Each stage's science by itself, on a video that is opened here: signatures say all that goes in and comes out.

    with open_video("film.mp4") as video:
        scenes = detect_scenes(video)
        people = [track_people(video, span) for span in scenes.spans]

docs/api.md chains them all. Importing this module imports the science (a second or two).
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from humanmm.models.camera.background.keyframes import describe_key_frames
from humanmm.models.camera.focal_length.intrinsics import estimate_intrinsics
from humanmm.models.camera.points import track_points
from humanmm.models.camera.shot_camera import estimate_camera
from humanmm.models.motion.assemble import record_motion
from humanmm.models.motion.fit.hmr import fit_shot
from humanmm.models.motion.refine.refine import refine
from humanmm.models.motion.world.align import ShotResults, align
from humanmm.models.perception.tracking.people import track_people
from humanmm.models.shot_detection.scenes import detect_scenes
from humanmm.models.shots.assemble import detect_shots
from humanmm.models.video.opened import Video
from humanmm.models.video.reading import read_facts

__all__ = [
    "ShotResults",
    "Video",
    "align",
    "describe_key_frames",
    "detect_scenes",
    "detect_shots",
    "estimate_camera",
    "estimate_intrinsics",
    "fit_shot",
    "open_video",
    "record_motion",
    "refine",
    "track_people",
    "track_points",
]


@contextmanager
def open_video(path: str | os.PathLike[str], *, max_side_px: int = 8192) -> Iterator[Video]:
    """The video at a path, every frame of it found to decode; closed on leaving the block.

    Raises OSError when the file cannot be opened, VideoError when fewer than two of its frames decode.
    """
    with Path(path).open("rb") as stream:
        yield Video(stream, read_facts(stream, max_side_px=max_side_px))
