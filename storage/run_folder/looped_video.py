"""A long video from a short one: the same packets over and over, nothing encoded again."""

import math
from pathlib import Path

import av

from humanmm.errors import VideoError


def write_looped(source: Path, target: Path, *, seconds: float) -> None:
    """The pictures of `source`, repeated whole until they last at least so long, as a .mkv. Where it begins again is a
    cut."""
    begin, length, lasts_s = _extent(source)
    with av.open(str(target), "w", format="matroska") as container:
        stream = None
        for lap in range(max(1, math.ceil(seconds / lasts_s))):
            with av.open(str(source)) as opened:
                stream = stream or container.add_stream_from_template(opened.streams.video[0])
                for packet in opened.demux(opened.streams.video[0]):
                    if packet.pts is not None and packet.dts is not None:
                        packet.pts += lap * length - begin
                        packet.dts += lap * length - begin
                        packet.stream = stream
                        container.mux(packet)


def _extent(source: Path) -> tuple[int, int, float]:
    """First time and length of the video in its own unit, and its length in seconds."""
    with av.open(str(source)) as opened:
        if not opened.streams.video:
            raise VideoError(f"{source} holds no video stream")
        stream = opened.streams.video[0]
        times = sorted(packet.pts for packet in opened.demux(stream) if packet.pts is not None)
        if len(times) < 2 or stream.time_base is None:
            raise VideoError(f"{source} holds no pictures with times")
        length = times[-1] - times[0] + (times[-1] - times[0]) // (len(times) - 1)
        return times[0], length, float(length * stream.time_base)
