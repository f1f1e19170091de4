"""Interlaced video: whether pictures are woven from two moments, and pictures that show one of them.

An interlaced picture holds two fields, the even rows (top) and the odd ones (bottom), filmed half a frame period apart.
What the file says of it is no evidence: film at 25 Hz is often marked as interlaced (both fields of one moment), and
converted files have lost the mark. Two things that only fields of different moments do are measured where something
moves, as in FFmpeg's filter `idet`: a row is as far from its neighbours in its own picture as in the next one (combs);
and the later field is nearer to the next picture than the earlier one. The latter also tells which field comes first.
"""

from collections.abc import Callable, Sequence
from typing import Literal

import cv2
import numpy as np
from av.video.format import VideoFormat
from av.video.frame import VideoFrame
from av.video.plane import VideoPlane
from jaxtyping import Int16, UInt8

from humanmm.models.records.video import Field

Array = np.ndarray
Rows = Int16[Array, "bands rows columns"]
Vote = Field | Literal["whole"]

_EVERY = 7
"""Of so many pictures one is compared with the next: an odd number, and not a multiple of telecine's 5 pictures."""
_BAND, _BAND_EVERY = 18, 54
"""Rows that are looked at in a picture of more than _COLUMNS_PX; of a smaller one, all. All numbers are even, so that
every other row of a band belongs to one field."""
_COLUMNS_PX = 400
"""About as many columns are looked at, or twice as many."""
_MOVES = 10
"""Gray levels by which a pixel differs from the next picture where something moves."""
_ONE_FIELD_PX = 240
"""Rows of one field of the smallest interlaced standard (480i): a picture so low is one field, or was made smaller."""
_LEAST_MOVING = 200
"""Samples that must move before two pictures say anything: with 50, 4 % of whole pictures seem to be woven."""
_LEAST_LEAD = 0.05
"""By how much one field is nearer to the next picture. Of 18 clips, whole: 99 % of their pictures are below 0.05 (H.264
and MPEG-2). Woven from two pictures each: 98 % are above (94 % at crf 32)."""
_LEAST_COMBS = 0.2
"""Difference of rows within the picture, divided by that to the rows of the next one: 0.05 to 0.2 in whole clips, 0.19
to 0.67 in woven ones."""

FEW, INTERLACED, MOST = 0.1, 0.2, 0.7
"""Shares of moving pictures that are woven: below FEW all are taken as whole, from INTERLACED on by one field, between
these and up to MOST with a warning. Whole clips have 0.01 at most, telecine 0.39 to 0.62, interlaced clips 0.73 at
least."""
_ONE_ORDER = 4
"""The field that comes first does so this many times as often as the other: in interlaced clips ten times at least. In
pictures made by doubling the rows of one field each, both seem to come first by turns."""

_HALFWAY = np.array([[-1], [9], [9], [-1]], np.float32) / 16
"""Cubic convolution halfway between two samples (Keys 1981, a = −1/2)."""


class FieldSearch:
    """Looks at the pictures of a video, one after the other, for fields of different moments.

    Takes 0.04 ms a picture of 720p, on average.
    """

    def __init__(self) -> None:
        self.votes: list[Vote] = []
        self._number, self._marked = 0, False
        self._before: Rows | None = None

    def look(self, picture: VideoFrame) -> None:
        """Take the next picture into account."""
        if picture.height <= _ONE_FIELD_PX:
            return
        turn = self._number % _EVERY
        self._number += 1
        self._marked |= picture.interlaced_frame
        if turn == 0:
            self._before = _sampled(_gray(picture))
        elif turn == 1 and self._before is not None:
            after = _sampled(_gray(picture))
            vote = compared(self._before, after) if after.shape == self._before.shape else None
            if vote is not None:
                self.votes.append(vote)

    def found(self) -> tuple[Field | None, list[str]]:
        """The field that comes first, None for a video of whole pictures; and what is doubtful about it."""
        return judged(self.votes, marked=self._marked)


def compared(picture: Rows, following: Rows) -> Vote | None:
    """What two successive pictures say of the first: "whole", or which of its fields comes first; None where too little
    moves. Bands begin with a row of the top field."""
    moves = np.abs(picture - following) > _MOVES
    moving = moves[:, 1:-1] & (moves[:, :-2] | moves[:, 2:])
    if np.count_nonzero(moving) < _LEAST_MOVING:
        return None
    twice = 2 * picture[:, 1:-1]
    to_next = np.abs(twice - following[:, :-2] - following[:, 2:]) * moving
    combs = (np.abs(twice - picture[:, :-2] - picture[:, 2:]) * moving).sum()
    bottom, top = int(to_next[:, 0::2].sum()), int(to_next[:, 1::2].sum())
    both = top + bottom
    if combs < _LEAST_COMBS * both or abs(top - bottom) < _LEAST_LEAD * both or both == 0:
        return "whole"
    return "top" if top > bottom else "bottom"


def judged(votes: Sequence[Vote], *, marked: bool) -> tuple[Field | None, list[str]]:
    """As `FieldSearch.found`. `marked`: the file says that it is interlaced."""
    top, bottom = votes.count("top"), votes.count("bottom")
    woven = top + bottom
    share = woven / max(len(votes), 1)
    if marked and len(votes) < 2:
        return None, [
            "the file says that it is interlaced, and too little moves to see it: pictures are taken as whole"
        ]
    if woven < 2 or share < FEW:
        return None, []
    seen = f"{woven} of {len(votes)} moving pictures that were looked at are interlaced, the others whole"
    if max(top, bottom) < _ONE_ORDER * min(top, bottom):
        unclear = (
            "pictures seem to be interlaced, now one field first and now the other (joined from several videos, or "
            "rows were doubled): they are taken as whole; if limbs are torn, convert the video by "
            "`ffmpeg -i FILE -vf bwdif=mode=send_frame NEW.mp4`"
        )
        return None, [unclear] if share >= MOST else []
    if share < INTERLACED:
        return None, [f"{seen}: all are taken as whole, and limbs of the former are torn"]
    mixed = f"{seen} (telecine, or edited from both): one field is used of all, half of the rows"
    return ("top" if top > bottom else "bottom"), [mixed] if share < MOST else []


def one_field(picture: VideoFrame, field: Field) -> VideoFrame:
    """The picture as it was at the moment of one field: its rows stay, the others are interpolated between them.

    In 4:2:0, rows of chroma belong to the fields in turn as well, and lie where they lie in a whole picture
    (ITU-T H.264, section 6.2), so that they are treated alike.
    """
    samples = _sample_type(picture.format)
    first = 0 if field == "top" else 1

    def keep(source: UInt8[Array, "H bytes"], target: UInt8[Array, "H bytes"]) -> None:
        kept = source[first::2]
        if len(source) < 2:
            target[:] = source
            return
        after = kept if samples is None else _halfway(kept.view(samples)).view(np.uint8)
        target[first::2] = kept
        others = target[1 - first :: 2]
        others[first:] = after[: len(others) - first]
        others[:first] = kept[:first]

    return _copied(picture, keep)


def whole(picture: VideoFrame) -> VideoFrame:
    """A copy that is not marked as interlaced: swscale would resample both fields of a marked one separately."""

    def keep(source: UInt8[Array, "H bytes"], target: UInt8[Array, "H bytes"]) -> None:
        target[:] = source

    return _copied(picture, keep)


def rows_of(plane: VideoPlane) -> UInt8[Array, "H bytes"]:
    """A plane's rows with their padding, sharing the picture's memory."""
    flat: Array = np.frombuffer(plane, np.uint8)  # type: ignore[call-overload]
    return flat.reshape(-1, plane.line_size)


def _copied(picture: VideoFrame, keep: Callable[[Array, Array], None]) -> VideoFrame:
    """A new picture of the same colours; `keep` fills each of its planes from the one of the old.

    PyAV cannot tell it where chroma lies: scaled, colours are off by up to half of their own pixel's width.
    """
    if picture.format.has_palette:
        return picture
    new = VideoFrame(picture.width, picture.height, picture.format.name)
    new.colorspace, new.color_range = picture.colorspace, picture.color_range
    new.color_primaries, new.color_trc = picture.color_primaries, picture.color_trc
    for source, target in zip(picture.planes, new.planes, strict=True):
        common = min(source.line_size, target.line_size) // 2 * 2
        keep(rows_of(source)[: source.height, :common], rows_of(target)[: source.height, :common])
    return new


def _halfway(kept: Array) -> Array:
    """The rows halfway between each row and the next."""
    return np.asarray(cv2.filter2D(kept, -1, _HALFWAY, anchor=(0, 1), borderType=cv2.BORDER_REPLICATE))


def _sample_type(pixels: VideoFormat) -> type[np.uint8] | type[np.uint16] | None:
    """What the bytes of a row are; None for packed bits and floats, whose rows are repeated."""
    bits = {component.bits for component in pixels.components}
    if bits == {8}:
        return np.uint8
    is_words = pixels.is_planar and not pixels.is_big_endian and min(bits) > 8 and max(bits) <= 16
    return np.uint16 if is_words else None


def _gray(picture: VideoFrame) -> UInt8[Array, "H W"]:
    """Luma, as it is stored if that is in bytes."""
    pixels = picture.format
    if not (pixels.is_planar and not pixels.is_rgb and pixels.components[0].bits == 8):
        picture = picture.reformat(format="gray")
    return rows_of(picture.planes[0])[: picture.height, : picture.width]


def _sampled(gray: UInt8[Array, "H W"]) -> Rows:
    """A third of the rows, in bands, and every so many columns; more of small pictures."""
    height, width = gray.shape
    columns = gray[:, :: 1 + width // _COLUMNS_PX]
    if height <= _COLUMNS_PX:
        return np.asarray(columns[None, : height // 2 * 2], np.int16)
    count = height // _BAND_EVERY
    bands = columns[: count * _BAND_EVERY].reshape(count, _BAND_EVERY, -1)[:, :_BAND]
    return np.asarray(bands, np.int16)
