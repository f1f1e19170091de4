"""Pictures of the ground, a few a shot, small and grey: around people, where shadows fall, and in whole frames."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from humanmm.models.geometry.boxes import box_area
from humanmm.models.perception.regions import invert, warp
from humanmm.models.records.shots import Box, Shot
from humanmm.models.records.tracks import PersonTrack

Array = np.ndarray

FRAMES = 6
"""Pictures a shot, evenly spread over its frames outside transitions."""
MOST_PEOPLE = 3
"""The ground around so many people is kept, the largest ones."""
LEAST_HEIGHT_PX = 24
"""Nobody whose box is lower casts a shadow that can be seen."""
BESIDE, ABOVE, BELOW = 1.3, 1.1, 0.9
"""How far the ground is kept from the bottom of a person's box, in heights of the box."""
MAX_SIDE_PX, WHOLE_SIDE_PX = 320, 640
"""Largest side of a picture of the ground around people, and of a whole frame."""
HIDDEN = 0
"""Grey level of pixels that show somebody or something burned in, and no ground."""
GROWN = 3
"""Silhouettes are grown by half of so many pixels of 128: their error."""


@dataclass(frozen=True)
class GroundPicture:
    """A part of a frame, reduced."""

    frame: int
    corner: Float[Array, "2"]
    """float32: its upper left corner, source pixels (centres at .5)."""
    scale: float
    """Source pixels that one of its pixels is wide and high."""
    gray: UInt8[Array, "height width"]
    """HIDDEN where somebody is, or something burned in."""

    def in_picture(self, K: Float[Array, "3 3"]) -> Float[Array, "3 3"]:
        """Intrinsics of the frame as those of this part of it."""
        reduced = K / self.scale
        reduced[:2, 2] = (K[:2, 2] - self.corner) / self.scale
        reduced[2] = K[2]
        return np.asarray(reduced)

    def pixels(self, box: Float[Array, "4"]) -> Float[Array, "4"]:
        """A box of the frame, xyxy in source pixels, in pixels of this part of it."""
        return np.asarray((box - np.tile(self.corner, 2)) / self.scale)


def ground_frames(shot: Shot) -> tuple[int, ...]:
    """The frames of a shot whose ground is kept; none where transitions leave nothing of it."""
    first, end = shot.outside_transitions
    return tuple(sorted({int(f) for f in np.linspace(first, end - 1, FRAMES).round()})) if first < end else ()


def ground_around(
    frame: int, gray: UInt8[Array, "height width"], people: Sequence[PersonTrack], scale: float
) -> GroundPicture | None:
    """The ground around the people of a frame, or None without any.

    `gray`: the whole frame; `scale`: source pixels that one of its pixels is wide.
    """
    seen = _seen_in(frame, people)
    tall = [track.bbox[row] for track, row in seen if track.bbox[row, 3] - track.bbox[row, 1] >= LEAST_HEIGHT_PX]
    if not tall:
        return None
    largest = np.stack(sorted(tall, key=lambda box: -float(box_area(box)))[:MOST_PEOPLE]) / scale
    height = largest[:, 3] - largest[:, 1]
    middle = 0.5 * (largest[:, 0] + largest[:, 2])
    low = np.array([(middle - BESIDE * height).min(), (largest[:, 3] - ABOVE * height).min()])
    high = np.array([(middle + BESIDE * height).max(), (largest[:, 3] + BELOW * height).max()])
    size = np.array(gray.shape[::-1])
    x0, y0 = np.clip(np.floor(low), 0, size).astype(int)
    x1, y1 = np.clip(np.ceil(high), 0, size).astype(int)
    if min(x1 - x0, y1 - y0) < LEAST_HEIGHT_PX:
        return None
    corner = np.array([x0, y0], np.float32) * np.float32(scale)
    return _without(seen, frame, gray[y0:y1, x0:x1], corner, scale, MAX_SIDE_PX)


def whole_frame(
    frame: int, gray: UInt8[Array, "height width"], people: Sequence[PersonTrack], scale: float
) -> GroundPicture:
    """A whole frame, see `ground_around`."""
    return _without(_seen_in(frame, people), frame, gray, np.zeros(2, np.float32), scale, WHOLE_SIDE_PX)


def hidden(picture: GroundPicture, boxes: Sequence[Box]) -> GroundPicture:
    """A picture without parts of its frame."""
    if not boxes:
        return picture
    gray = picture.gray.copy()
    for box in boxes:
        _inside(gray, picture.pixels(np.array(box)))[:] = HIDDEN
    return replace(picture, gray=gray)


def _inside(gray: np.ndarray, box: Float[Array, "4"]) -> np.ndarray:
    """The part of a picture that lies in a box of its pixels."""
    x0, y0, x1, y1 = np.maximum(np.round(box), 0).astype(int)
    return gray[y0:y1, x0:x1]


def _seen_in(frame: int, people: Sequence[PersonTrack]) -> list[tuple[PersonTrack, int]]:
    """Who is seen in a frame, with the row of his track."""
    return [(track, int(row)) for track in people for row in np.flatnonzero(track.frame == frame)]


def _without(
    seen: Sequence[tuple[PersonTrack, int]],
    frame: int,
    part: UInt8[Array, "height width"],
    corner: Float[Array, "2"],
    scale: float,
    most_px: int,
) -> GroundPicture:
    """A part of a frame, no side of it longer than `most_px`, with the people in it left out."""
    smaller = max(1.0, max(part.shape) / most_px)
    if smaller > 1:
        # one factor for both sides: what does not fill a last pixel is cut off
        h, w = (max(1, int(side / smaller)) for side in part.shape)
        part = cv2.resize(part[: round(h * smaller), : round(w * smaller)], (w, h), interpolation=cv2.INTER_AREA)
    picture = GroundPicture(frame, corner, float(scale * smaller), np.maximum(part, HIDDEN + 1))
    for track, row in seen:
        picture.gray[_silhouette(picture, track, row)] = HIDDEN
    return picture


def _silhouette(picture: GroundPicture, track: PersonTrack, row: int) -> Bool[Array, "height width"]:
    """Where a person is, a little too large; where no silhouette is known, in his whole box."""
    mask = track.masks.mask(row)
    if not mask.any():
        inside = np.zeros(picture.gray.shape, bool)
        _inside(inside, picture.pixels(track.bbox[row]))[:] = True
        return inside
    to_mask = invert(track.mask_affine[row].astype(np.float64))
    to_mask[:, 2] += to_mask[:, :2] @ picture.corner
    to_mask[:, :2] *= picture.scale
    height, width = picture.gray.shape
    grown = cv2.dilate(mask, np.ones((GROWN, GROWN), np.uint8))
    return np.asarray(warp(grown, to_mask, (width, height), nearest=True) > 0)
