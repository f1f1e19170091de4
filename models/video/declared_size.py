"""The picture size that a container's header declares, read from its bytes before any decoder is touched.

A decoder takes the size from the coded pictures and silently corrects the header; a header that declares a picture of
16,384 × 16,384 pixels is either wrong or a video that no machine here can decode, and both are refused. Only the few
bytes on the way to the declared size are read; anything unexpected means "no size declared", never an error.
"""

import contextlib
import struct
from collections.abc import Iterator
from typing import BinaryIO

_MP4_FOLDERS = (b"moov", b"trak", b"mdia", b"minf", b"stbl")
_EBML_SEGMENT, _EBML_TRACKS, _EBML_ENTRY, _EBML_VIDEO = 0x18538067, 0x1654AE6B, 0xAE, 0xE0
_EBML_WIDTH, _EBML_HEIGHT = 0xB0, 0xBA
_MP4_BEGINS = (b"ftyp", b"moov", b"mdat", b"free", b"skip", b"wide")
_MAX_BOXES = 10_000
"""No sane header has more; a crafted one must not keep us busy."""
_MAX_TAGS = 1_000_000
"""Pictures and pieces of sound of an flv of four hours; they are read in a second or two."""


def declared_sides_px(stream: BinaryIO) -> tuple[int, ...]:
    """Every picture side that the header of an mp4, mov, mkv, webm or avi file declares; empty if it declares none.

    The stream's position is left at the start.
    """
    stream.seek(0, 2)
    size = stream.tell()
    stream.seek(0)
    magic = stream.read(12)
    try:
        if magic[:4] == b"\x1aE\xdf\xa3":
            return tuple(_matroska_sides(stream, size))
        if magic[:4] == b"RIFF" and magic[8:12] == b"AVI ":
            return _avi_sides(stream)
        if magic[4:8] in _MP4_BEGINS:
            return tuple(_mp4_sides(stream, 0, size, [_MAX_BOXES]))
        return ()
    except (struct.error, IndexError, OverflowError):
        return ()
    finally:
        stream.seek(0)


def count_movies(stream: BinaryIO) -> int:
    """How many whole mp4, mov or flv files lie one after the other in one file, of which only the first is read; 0 or 1
    for other containers and for files in fragments. The stream's position is left at the start."""
    stream.seek(0)
    if stream.read(3) == b"FLV":
        return _count_flv(stream)
    kinds = [kind for kind, _ in _top_boxes(stream)]
    return 1 if b"moof" in kinds else kinds.count(b"moov")


def lacks_index(stream: BinaryIO) -> bool:
    """Whether a file begins as mp4 or mov, and ends before its index (`moov`) or inside it. The stream's position is
    left at the start."""
    size, ends = stream.seek(0, 2), dict(_top_boxes(stream))
    begins = next(iter(ends), b"") in _MP4_BEGINS
    return begins and ends.get(b"moov", size + 1) > size


def _top_boxes(stream: BinaryIO) -> Iterator[tuple[bytes, int]]:
    """Kind of each outermost box of an mp4 or mov file, and the position at which it says that it ends."""
    size, at = stream.seek(0, 2), 0
    with contextlib.suppress(struct.error):
        for _ in range(_MAX_BOXES):
            if at + 8 > size:
                break
            stream.seek(at)
            length, kind = struct.unpack(">I4s", stream.read(8))
            if length == 1:
                (length,) = struct.unpack(">Q", stream.read(8))
            at = at + length if length >= 8 else size
            yield kind, at
    stream.seek(0)


def _count_flv(stream: BinaryIO) -> int:
    """How many flv files lie one after the other; each is a header and then tags with their length before and after."""
    at, count = 0, 0
    for _ in range(_MAX_TAGS):
        stream.seek(at)
        head = stream.read(9)
        if len(head) < 9:
            break
        if head[:3] == b"FLV":
            count += 1
            at += int.from_bytes(head[5:9], "big") + 4
        else:
            at += 11 + int.from_bytes(head[1:4], "big") + 4
    stream.seek(0)
    return count


def _mp4_sides(stream: BinaryIO, begin: int, end: int, budget: list[int]) -> Iterator[int]:
    """Sides in `tkhd` (track) and in the first sample entry of a visual track's `stsd` between two file positions."""
    visual = False
    while begin + 8 <= end and budget[0] > 0:
        budget[0] -= 1
        stream.seek(begin)
        length, kind = struct.unpack(">I4s", stream.read(8))
        body = begin + 8
        if length == 1:
            (length,) = struct.unpack(">Q", stream.read(8))
            body += 8
        box_end = end if length == 0 else min(begin + length, end)
        if box_end <= body - 8:
            return
        if kind in _MP4_FOLDERS:
            if kind != b"minf" or visual:
                yield from _mp4_sides(stream, body, box_end, budget)
        elif kind == b"hdlr":
            stream.seek(body + 8)
            visual = stream.read(4) == b"vide"
        elif kind == b"tkhd":
            stream.seek(box_end - 8)
            yield from (side >> 16 for side in struct.unpack(">II", stream.read(8)))
        elif kind == b"stsd":
            # version and flags, count, then the first entry: size, format, 6 reserved, reference, 16 reserved, sides
            stream.seek(body + 8 + 32)
            yield from struct.unpack(">HH", stream.read(4))
        begin = box_end


def _matroska_sides(stream: BinaryIO, size: int) -> Iterator[int]:
    """PixelWidth and PixelHeight of every track."""
    for segment, segment_end in _ebml(stream, 0, size, _EBML_SEGMENT):
        for tracks, tracks_end in _ebml(stream, segment, segment_end, _EBML_TRACKS):
            for entry, entry_end in _ebml(stream, tracks, tracks_end, _EBML_ENTRY):
                for video, video_end in _ebml(stream, entry, entry_end, _EBML_VIDEO):
                    for wanted in (_EBML_WIDTH, _EBML_HEIGHT):
                        for at, to in _ebml(stream, video, video_end, wanted):
                            stream.seek(at)
                            yield int.from_bytes(stream.read(min(to - at, 8)), "big")
            return


def _ebml(stream: BinaryIO, begin: int, end: int, wanted: int) -> Iterator[tuple[int, int]]:
    """Begin and end of the content of every element with an id, among the siblings between two positions."""
    for _ in range(_MAX_BOXES):
        if begin >= end:
            return
        stream.seek(begin)
        head = stream.read(12)
        id_length = 9 - head[0].bit_length()
        element = int.from_bytes(head[:id_length], "big")
        size_length = 9 - head[id_length].bit_length()
        if id_length > 4 or size_length > 8:
            return
        length = int.from_bytes(head[id_length : id_length + size_length], "big") & ((1 << 7 * size_length) - 1)
        content = begin + id_length + size_length
        unknown_length = length == (1 << 7 * size_length) - 1
        content_end = end if unknown_length else min(content + length, end)
        if element == wanted:
            yield content, content_end
        begin = content_end


def _avi_sides(stream: BinaryIO) -> tuple[int, ...]:
    """Width and height of the main AVI header, and of the first video stream's bitmap header."""
    stream.seek(0)
    head = stream.read(4096)
    sides: list[int] = []
    main = head.find(b"avih")
    if main >= 0:
        sides += struct.unpack("<II", head[main + 40 : main + 48])
    video = head.find(b"vids")
    bitmap = head.find(b"strf", video) if video >= 0 else -1
    if bitmap >= 0:
        sides += (abs(side) for side in struct.unpack("<ii", head[bitmap + 12 : bitmap + 20]))
    return tuple(sides)
