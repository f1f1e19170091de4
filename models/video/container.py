"""Opening a video: an already open binary stream in, PyAV's container and one video stream out.

Only demuxers that read the bytes they are given are allowed: a playlist or a concat script named .mp4 would otherwise
make the library open other files.
"""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import BinaryIO

import av
import numpy as np
from av.container import InputContainer
from av.packet import Packet
from av.stream import Disposition
from av.video.codeccontext import VideoCodecContext
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from humanmm.errors import VideoError
from humanmm.machine import resident_mb
from humanmm.models.video.declared_size import declared_sides_px, lacks_index

DEMUXERS = "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpegts,flv"
"""Containers of pictures; no playlists, no text, no image sequences, no devices."""

_DECODER_THREADS = 4
"""Fixed, not the number of cores: how a decoder recovers from damage depends on it, and facts must fit every reader."""

_THREADS_MB = 1200.0
"""Beyond this the threads share one picture (slices): each thread that has a picture of its own keeps two more."""

_ALIAS = {"libdav1d": "av1", "libaom-av1": "av1"}

_KEPT_PICTURES = {"h264": 18, "hevc": 18, "vvc": 18, "vp8": 6, "vp9": 10, "av1": 10}
"""Pictures that a decoder keeps at most at the same time: references, the current one and the one given out. H.264 and
HEVC allow 16 references, whatever a level says. Decoders of other codecs keep 5."""

_LEAST_PICTURES = 3
"""That a decoder keeps of any codec: a reference, the current one and the one given out."""

_SIDE_BYTES = {"h264": 0.5, "hevc": 0.75, "vvc": 2.0, "vp9": 0.2, "av1": 0.1, "jpeg2000": 8.0}
"""Bytes beside each pixel of a picture, as measured: motion vectors (HEVC: 12 bytes for 4 x 4 pixels), coefficients."""

_REJECTED = (
    av.error.InvalidDataError,
    av.error.PatchWelcomeError,
    av.error.BugError,
    av.error.ExternalError,
    av.error.ArgumentError,
)
"""What decoders say of a damaged packet: zlib's (PNG) that an external library failed, raw video's that it is short."""

_CUT_OFF = "the file is cut off (its index is missing); copy or download it again"

_SUPPORTED = "mp4, mov, mkv, webm or avi"


@contextmanager
def open_video(stream: BinaryIO, *, max_side_px: int = 16384) -> Iterator[tuple[InputContainer, VideoStream]]:
    """The container and its video stream, ready to decode from the start; `stream` itself stays open.

    Raises VideoError when this is no video, or when it declares a picture side above max_side_px.
    """
    refuse_absurd_size(max(declared_sides_px(stream), default=0), max_side_px)
    limit = str(max_side_px * max_side_px)
    stream.seek(0)
    try:
        container = av.open(stream, mode="r", options={"format_whitelist": DEMUXERS}, metadata_errors="replace")
    except av.error.EOFError as error:
        raise VideoError(f"the file is empty or ends inside its header; give a complete {_SUPPORTED} file") from error
    except (av.error.InvalidDataError, av.error.ArgumentError) as error:
        if lacks_index(stream):
            raise VideoError(_CUT_OFF) from error
        stream.seek(0, 2)
        what = "the file is empty" if stream.tell() == 0 else "this is not a video, or its header is missing"
        raise VideoError(f"{what}: no {_SUPPORTED} data was recognised; give such a file") from error
    except av.error.FFmpegError as error:
        raise VideoError(f"the video cannot be opened ({error.strerror}); give a {_SUPPORTED} file") from error
    with container:
        video = container.streams.best("video")
        if not isinstance(video, VideoStream) or not moving_pictures(container):
            nothing = "the file holds no moving pictures (sound or a cover picture only); give a video"
            raise VideoError(_CUT_OFF if lacks_index(stream) else nothing)
        if video.frames == 1:  # a cover that does not say that it is one
            video = max(moving_pictures(container), key=lambda stream: stream.frames)
        if video.codec_context is None:
            raise VideoError("the video's codec is unknown here; convert it to H.264, H.265, VP9, AV1 or MPEG-4")
        refuse_absurd_size(max(video.codec_context.width, video.codec_context.height), max_side_px)
        set_threads(video)
        video.codec_context.options = {"max_pixels": limit}
        yield container, video


def moving_pictures(container: InputContainer) -> list[VideoStream]:
    """The streams of pictures that are no cover."""
    return [s for s in container.streams.video if not s.disposition & Disposition.attached_pic]


def refuse_absurd_size(side_px: int, max_side_px: int) -> None:
    """Raise VideoError for a declared picture side above the limit."""
    if side_px > max_side_px:
        raise VideoError(
            f"the header declares a picture side of {side_px} px, more than decode.max_side_px = {max_side_px}; "
            "scale the video down, or raise that setting"
        )


def set_threads(video: VideoStream) -> None:
    """Threads for a decoder: each with a picture of its own while these are small, else all at one picture. dav1d knows
    no slices: at large pictures it has one thread."""
    most_mb, picture_mb = decoder_mb(video.codec_context)
    is_small = most_mb + 2 * _DECODER_THREADS * picture_mb <= _THREADS_MB
    video.thread_type = "AUTO" if is_small else "SLICE"
    video.codec_context.thread_count = _DECODER_THREADS if is_small or _codec(video.codec_context) != "av1" else 1


def decoder_mb(codec: VideoCodecContext) -> tuple[float, float]:
    """Memory that a decoder may need at most for the pictures that it keeps, and for one of them, MB."""
    picture_format = codec.format
    bits = picture_format.padded_bits_per_pixel if picture_format is not None else 12
    name = _codec(codec)
    picture_mb = codec.width * codec.height * (bits / 8 + _SIDE_BYTES.get(name, 0.0)) / 1e6
    return _KEPT_PICTURES.get(name, 5) * picture_mb, picture_mb


def _codec(codec: VideoCodecContext) -> str:
    return _ALIAS.get(codec.name, codec.name)


class DecoderMemory:
    """Watches what a decoder takes while a video is decoded for the first time.

    How many pictures a decoder keeps, the stream says in places that PyAV does not show, and may say wrongly. Small
    pictures cannot exceed the limit. Of large ones the growth of this process is compared with it, packet by packet.
    """

    def __init__(self, codec: VideoCodecContext, max_memory_mb: float) -> None:
        self._codec, self._max_mb = codec, max_memory_mb
        self._before_mb = resident_mb()

    def check(self, packet_bytes: int = 0) -> None:
        """Raise VideoError for pictures of which a decoder needs more memory than the limit. What is hardly or not
        compressed is in memory once more, as the packet that it came in."""
        most_mb, picture_mb = decoder_mb(self._codec)
        if most_mb <= self._max_mb:
            return
        needed_mb = max(_LEAST_PICTURES * picture_mb + packet_bytes / 1e6, resident_mb() - self._before_mb)
        if needed_mb > self._max_mb:
            raise VideoError(
                f"{self._codec.width} x {self._codec.height} px as {self._codec.pix_fmt} are {picture_mb:.0f} MB a "
                f"picture, of which a decoder of {_codec(self._codec)} keeps several: {needed_mb:.0f} MB are more than "
                f"decode.max_memory_mb = {self._max_mb:.0f}; scale the video down, or raise that setting"
            )


@dataclass
class PacketLog:
    """Facts of the packets, noted while their pictures were decoded."""

    keyframe_pts: set[int] = field(default_factory=set)
    dts: list[int] = field(default_factory=list)
    num_packets: int = 0
    end: int = 0
    """When the last picture ends, in the stream's time base."""
    broken: int = 0
    """Packets that the decoder rejected."""
    left_out: int = 0
    """Packets that the container's edit list does not show."""
    ended_early: bool = False
    """The container's bytes stopped making sense before its end."""


def declared_pictures(container: InputContainer, video: VideoStream, log: PacketLog) -> int:
    """How many pictures the file says that it holds; 0 where it does not say.

    AVI counts moments of its rate, and leaves those without a new picture empty: between two packets, and after the
    last one for no longer than between others.
    """
    if container.format.name != "avi" or len(log.dts) < 2:
        return video.frames
    steps = np.diff(np.sort(log.dts))
    return video.frames - int((steps - 1).clip(0).sum() + max(steps.max() - 1, 0))


def declared_end_s(container: InputContainer, video: VideoStream) -> float | None:
    """When the pictures end by the header of a Matroska file, seconds; None for other containers, and where the header
    says it of several streams together."""
    if "matroska" not in container.format.name:
        return None
    of_stream = re.fullmatch(r"(\d+):(\d\d):(\d\d(?:\.\d+)?)", video.metadata.get("DURATION", ""))
    if of_stream:
        hours, minutes, seconds = map(float, of_stream.groups())
        return 3600 * hours + 60 * minutes + seconds
    if len(container.streams) > 1 or container.duration is None:
        return None
    return container.duration / 1e6


def decoded(
    container: InputContainer, video: VideoStream, log: PacketLog, memory: DecoderMemory | None = None
) -> Iterator[VideoFrame]:
    """Every picture that decodes from here on, in presentation order; damage is logged and stepped over."""
    packets = container.demux(video)
    while True:
        try:
            packet: Packet[VideoStream] = next(packets)
        except StopIteration:
            return
        except av.error.FFmpegError:
            log.ended_early = True
            packet = None  # type: ignore[assignment]
        if packet is not None and packet.size:
            log.num_packets += 1
            if memory is not None:
                memory.check(packet.size)
            log.left_out += packet.is_discard
            if packet.pts is not None:
                log.end = max(log.end, packet.pts + (packet.duration or 0))
            if packet.is_keyframe and packet.pts is not None:
                log.keyframe_pts.add(packet.pts)
            if packet.dts is not None:
                log.dts.append(packet.dts)
        try:
            yield from video.decode(packet)
        except av.error.EOFError:
            return
        except _REJECTED:
            log.broken += 1
        if memory is not None:
            memory.check()
        if packet is None:
            return
