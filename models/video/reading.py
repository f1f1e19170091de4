"""Facts of a video: every frame is decoded once, so that the facts list exactly the frames that can be delivered.

The container alone cannot be trusted: its frame count is missing (mkv), counts frames outside the edit list (mp4) or
frames that a truncated or damaged file no longer holds. Decoding without the in-loop filters costs about 1.7 ms of
processor time a frame at 720p, and cannot change which frames come out; nor how light they are.
"""

import gc
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import pairwise
from typing import BinaryIO

import numpy as np
from av.container import InputContainer
from av.sidedata.sidedata import SideData
from av.video.frame import PictureType, VideoFrame
from av.video.stream import VideoStream
from jaxtyping import Float

from humanmm.errors import VideoError
from humanmm.models.records.video import VideoFacts
from humanmm.models.video.container import (
    DecoderMemory,
    PacketLog,
    declared_end_s,
    declared_pictures,
    decoded,
    moving_pictures,
    open_video,
    refuse_absurd_size,
)
from humanmm.models.video.declared_size import count_movies
from humanmm.models.video.fields import FieldSearch
from humanmm.models.video.frame_times import check_times, long_gap_s, longest_gap_s
from humanmm.models.video.light import light_of
from humanmm.models.video.square_pixels import shape_of_pixels, square_size

MISSING_S = 0.5
"""Pictures that end this much before the container says that they do are missing: a declared end is off by a picture or
two, and by the length of a packet of sound."""


@dataclass
class _Pictures:
    """What decoding every picture once has shown."""

    log: PacketLog = field(default_factory=PacketLog)
    size: tuple[int, int] = (0, 0)
    """Width and height of the first, as it is stored."""
    orientation: tuple[int, bool] = (0, False)
    aspects: list[Fraction | None] = field(default_factory=list)
    """Sample aspect ratios that the stream has said, each once."""
    fields: FieldSearch = field(default_factory=FieldSearch)
    light: list[int] = field(default_factory=list)
    """As `light_of` tells it."""
    pts: list[int | None] = field(default_factory=list)
    intra: set[int | None] = field(default_factory=set)
    resized: int = 0
    damaged: int = 0


def read_facts(stream: BinaryIO, *, max_side_px: int = 8192, max_memory_mb: float = 850) -> VideoFacts:
    """Facts of the video in an open, seekable binary stream. Raises VideoError when fewer than two frames decode, or
    when their time stamps cannot be true."""
    with open_video(stream, max_side_px=max_side_px) as (container, video):
        memory = DecoderMemory(video.codec_context, max_memory_mb)
        memory.check()
        pictures = _decode_all(container, video, memory, max_side_px=max_side_px)
        time_base, pts = video.time_base, pictures.pts
        if not pts or time_base is None:
            raise VideoError(f"no picture of the video {_why_none(pictures.log)}")
        if len(pts) == 1:
            raise VideoError("the video holds one picture only; motion needs at least two frames")
        counted = _times_are_guesses(pts, container.format.name, video)
        kept = _counted_pts(pts, pictures.log) if counted else _increasing_pts(pts)
        light_at = dict(zip(reversed(kept if counted else pts), reversed(pictures.light), strict=True))
        time_s = np.array([float(p * time_base) for p in kept])
        check_times(time_s, num_pictures=len(pts))
        aspect, doubts = shape_of_pixels(video.sample_aspect_ratio, pictures.aspects, pictures.size)
        size = square_size(pictures.size, aspect)
        refuse_absurd_size(max(size), max_side_px)
        first_field, uncertain = pictures.fields.found()
        warnings = [
            *_warnings(pictures, container, video, time_s),
            *doubts,
            *uncertain,
            *_other_videos(stream, container, pictures, is_timed=not counted),
        ]
        if counted:
            warnings.append("the container keeps no presentation times: a constant frame rate is assumed")
        codec, container_name = video.codec_context.name, container.format.name

    # a stream with gradual intra refresh flags ordinary pictures as keyframes: decoding must not start there
    keyframe = np.array([p in pictures.log.keyframe_pts and p in pictures.intra for p in kept])
    if counted:
        keyframe[:] = False
    keyframe[0] = True
    rotation_deg, mirrored = pictures.orientation
    width, height = size[::-1] if rotation_deg in (90, 270) else size
    gc.collect()  # PyAV ties a picture and its side data in a circle, which would keep the decoder's pictures
    return VideoFacts(
        width=width,
        height=height,
        time_s=time_s,
        keyframe=keyframe,
        rotation_deg=rotation_deg,
        codec=codec,
        container=container_name,
        warnings=tuple(warnings),
        mirrored=mirrored,
        counted=counted,
        coded_size=pictures.size,
        sample_aspect_ratio=(aspect.numerator, aspect.denominator),
        first_field=first_field,
        light=np.array([light_at[p] for p in kept], np.uint8),
    )


def _decode_all(container: InputContainer, video: VideoStream, memory: DecoderMemory, *, max_side_px: int) -> _Pictures:
    found = _Pictures()
    if video.codec_context.name in ("h264", "hevc"):
        video.codec_context.options = video.codec_context.options | {"skip_loop_filter": "all"}
    for picture in decoded(container, video, found.log, memory):
        size = picture.width, picture.height  # which may change inside the video
        if not found.pts:
            found.size, found.orientation = size, _orientation(picture)
        refuse_absurd_size(max(size), max_side_px)
        aspect = video.codec_context.sample_aspect_ratio
        if aspect not in found.aspects:
            found.aspects.append(aspect)
        found.fields.look(picture)
        found.resized += size != found.size
        found.damaged += picture.is_corrupt
        found.light.append(light_of(picture))
        found.pts.append(picture.pts)
        if picture.pict_type == PictureType.I:
            found.intra.add(picture.pts)
    return found


def _why_none(log: PacketLog) -> str:
    if not log.num_packets:
        return "is in it: its track is empty: give an intact copy"
    if log.left_out == log.num_packets:
        return (
            "is to be shown: the file's edit list leaves out all of them; write it anew, for instance with "
            "`ffmpeg -ignore_editlist 1 -i FILE -c copy NEW.mp4`"
        )
    return "could be decoded; the file is damaged: give an intact copy"


def _warnings(
    pictures: _Pictures, container: InputContainer, video: VideoStream, time_s: Float[np.ndarray, " F"]
) -> Iterator[str]:
    """What is wrong with the pictures and their times, one sentence each."""
    log, num_pictures = pictures.log, len(pictures.pts)
    if log.broken:
        yield f"the file is damaged: {log.broken} packets could not be decoded, and what they held is missing"
    if pictures.damaged:
        yield f"the file is damaged: {pictures.damaged} pictures decode with errors, and people may look torn in them"
    declared = declared_pictures(container, video, log)
    # DivX files hold packets that show no picture of their own: nothing is missing there
    if log.ended_early or declared > max(num_pictures + log.broken, log.num_packets):
        of_declared = f"of {declared} declared frames " if declared else ""
        yield f"the file is incomplete: {of_declared}{num_pictures} decode, the last at {time_s[-1]:.2f} s"
    else:
        declared_s, end_s = declared_end_s(container, video), float(log.end * (video.time_base or 0))
        if declared_s is not None and declared_s - end_s > MISSING_S:
            yield f"the file is incomplete: it declares {declared_s:.2f} s of pictures, and they end at {end_s:.2f} s"
    if len(time_s) < num_pictures:
        equal, backwards = _unusable_times(pictures.pts)
        if equal:
            yield f"{equal} pictures have the time stamp of the one before and are left out: motion there is less dense"
        if backwards:
            yield f"{backwards} pictures have an earlier time stamp than the one before and are left out"
    before, gap_s = longest_gap_s(time_s)
    if gap_s > long_gap_s(time_s):
        yield (
            f"after {before:.2f} s no picture comes for {gap_s:.1f} s: the recording stood still, or pictures are "
            "missing; motion in between is a guess"
        )
    if pictures.resized:
        size = f"{pictures.size[0]} x {pictures.size[1]} px"
        yield f"the picture size changes inside the video: {pictures.resized} frames are scaled to {size}"


def _other_videos(stream: BinaryIO, container: InputContainer, pictures: _Pictures, *, is_timed: bool) -> Iterator[str]:
    """Whether the file holds more than the one video that is read, one sentence each."""
    known = [p for p in pictures.pts if p is not None]
    begins_again = any(p <= known[0] and after > p for p, after in pairwise(known[1:]))
    if count_movies(stream) > 1 or (is_timed and begins_again):
        yield (
            "the file holds several videos one after the other, of which the first is read; "
            "ffmpeg's concat demuxer joins them"
        )
    streams = moving_pictures(container)
    if len(streams) > 1:
        size = f"{pictures.size[0]} x {pictures.size[1]} px"
        yield f"the file holds {len(streams)} streams of pictures; the one of {len(known)} pictures, {size}, is read"


def _times_are_guesses(pts: list[int | None], container: str, video: VideoStream) -> bool:
    """Whether time stamps are the decoder's guess: AVI stores none, which matters once frames are reordered."""
    if any(p is None for p in pts):
        return True
    known = [p for p in pts if p is not None]
    reordered = bool(video.codec_context.has_b_frames) or bool((np.diff(known) <= 0).any())
    return container == "avi" and reordered


def _counted_pts(pts: list[int | None], log: PacketLog) -> list[int]:
    """Presentation times for pictures that come in order without their own: the decoding times, sorted, from zero."""
    if len(set(log.dts)) == len(pts):
        ordered = sorted(log.dts)
        return [dts - ordered[0] for dts in ordered]
    steps = np.diff(sorted(set(log.dts)))
    step = int(np.median(steps)) if len(steps) else 1
    return [i * step for i in range(len(pts))]


def _increasing_pts(pts: list[int | None]) -> list[int]:
    """The time stamps that are later than all before them."""
    kept: list[int] = []
    for p in pts:
        if p is not None and (not kept or p > kept[-1]):
            kept.append(p)
    return kept


def _unusable_times(pts: list[int | None]) -> tuple[int, int]:
    """How many pictures have the time stamp of the last one that counts, and how many an earlier one."""
    equal = backwards = 0
    latest: int | None = None
    for p in pts:
        if p is None or (latest is not None and p < latest):
            backwards += 1
        elif p == latest:
            equal += 1
        else:
            latest = p
    return equal, backwards


def _orientation(picture: VideoFrame) -> tuple[int, bool]:
    """Clockwise rotation (0, 90, 180, 270) and left-right flip that make the stored picture upright.

    The display matrix [a b; c d] sends stored (x, y) to shown (a x + c y, b x + d y), y down, 16.16 fixed point.
    """
    matrix = next((bytes(data) for data in _side_data(picture) if data.type.name == "DISPLAYMATRIX"), b"")
    if len(matrix) < 36:
        return 0, False
    a, b, _, c, d, *_ = struct.unpack("=9i", matrix[:36])
    mirrored = a * d - b * c < 0
    if mirrored:
        a, b = -a, -b
    angle_deg = np.degrees(np.arctan2(b, a))
    return int(round(angle_deg / 90) * 90) % 360, mirrored


def _side_data(picture: VideoFrame) -> Iterator[SideData]:
    """The blocks of side data (the container is also a mapping, and typed as one)."""
    return iter(picture.side_data)  # type: ignore[arg-type]
