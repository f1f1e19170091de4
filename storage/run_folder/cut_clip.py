"""A clip cut from other videos: spans of frames, cropped, one after the other, with a poster put up where one is
wanted."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8

from humanmm.errors import InputError
from humanmm.models.benchmark.expectations import Box, Part, Poster
from humanmm.models.video.colors import BT601
from humanmm.models.video.frames import frames
from humanmm.models.video.reading import read_facts
from humanmm.storage.run_folder.picture_files import write_video

QUALITY = 14
"""x264's constant rate factor: the eye sees no difference from the source."""

Picture = UInt8[np.ndarray, "height width 3"]


def write_cut_clip(path: Path, parts: Sequence[Part], folder: Path, *, size: tuple[int, int] | None = None) -> None:
    """Write the parts as one mp4; the same bytes for the same videos, libraries and processor.

    `folder` holds the videos that parts name. Every frame of a part is one frame of the clip, whatever the part's own
    rate. `size` (width, height) is the first part's unless given; pictures fill it, and are cut off about the middle.
    """
    with (folder / parts[0].video).open("rb") as stream:
        facts = read_facts(stream)
    x0, y0, x1, y1 = _pixels(parts[0].crop, facts.width, facts.height)
    width, height = size or ((x1 - x0) // 2 * 2, (y1 - y0) // 2 * 2)

    def pictures() -> Iterator[tuple[float, np.ndarray]]:
        number = 0
        for part in parts:
            for picture in _part(part, folder):
                yield number / facts.fps, cv2.cvtColor(filling(picture, width, height), cv2.COLOR_RGB2YUV_I420)
                number += 1

    write_video(path, pictures(), width=width, height=height, fps=facts.fps, colors=BT601, quality=QUALITY)


def filling(picture: Picture, width: int, height: int) -> Picture:
    """The picture in another size, its aspect kept, what is too wide or too high cut off on both sides."""
    scale = max(width / picture.shape[1], height / picture.shape[0])
    scaled_size = max(width, round(picture.shape[1] * scale)), max(height, round(picture.shape[0] * scale))
    if scaled_size != (picture.shape[1], picture.shape[0]):
        method = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
        picture = np.asarray(cv2.resize(picture, scaled_size, interpolation=method), np.uint8)
    left, top = (picture.shape[1] - width) // 2, (picture.shape[0] - height) // 2
    return np.ascontiguousarray(picture[top : top + height, left : left + width])


def _part(part: Part, folder: Path) -> Iterator[Picture]:
    poster = None if part.poster is None else _poster(part.poster, folder)
    with (folder / part.video).open("rb") as stream:
        facts = read_facts(stream)
        start, end = part.frames or (0, facts.num_frames)
        if not start < end <= facts.num_frames:
            raise InputError(f"frames {start} to {end} are wanted of {part.video}, which has {facts.num_frames}")
        for frame in frames(stream, facts, start, end):
            picture = frame.image
            if poster is not None and part.poster is not None:
                picture = picture.copy()
                x0, y0, x1, y1 = _pixels(part.poster.at, facts.width, facts.height)
                picture[y0:y1, x0:x1] = filling(poster, x1 - x0, y1 - y0)
            x0, y0, x1, y1 = _pixels(part.crop, facts.width, facts.height)
            yield picture[y0:y1, x0:x1]


def _poster(poster: Poster, folder: Path) -> Picture:
    with (folder / poster.video).open("rb") as stream:
        facts = read_facts(stream)
        if poster.frame >= facts.num_frames:
            raise InputError(f"frame {poster.frame} is wanted of {poster.video}, which has {facts.num_frames}")
        picture = next(frames(stream, facts, poster.frame, poster.frame + 1)).image
    x0, y0, x1, y1 = _pixels(poster.crop, facts.width, facts.height)
    return picture[y0:y1, x0:x1]


def _pixels(box: Box, width: int, height: int) -> tuple[int, int, int, int]:
    x0, y0, x1, y1 = (round(side * of) for side, of in zip(box, (width, height, width, height), strict=True))
    return x0, y0, x1, y1
