"""Whether what looks like somebody moves by himself, or with the wall behind him as a picture of a person does.

Corners on the silhouette and around it are followed by pyramidal Lucas-Kanade from one look at the person to a later
one. A wall moves by a plane's homography (Hartley and Zisserman 2004, section 13.1), and every corner of a picture on
it by the same one, however the camera moves. Somebody alive sways and moves head and limbs, even when he sits.
"""

from collections.abc import Collection
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from humanmm.models.perception.observation import Observation
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import HEIGHT_OF_SIDE, Region, invert, warp

Array = np.ndarray

PERIOD_S = 0.4
"""Between two looks at one person."""
BACK_S = 1.25
"""A look is compared with the oldest one that is no older than this: after a second everybody has swayed."""
LEAST_S = 0.7
"""Who has not moved by himself in less time than this may be anybody: that is not counted."""

ALIVE, NOISE_PX = 0.003, 0.8
"""Own motion in a second that lies between pictures and people: a fraction of the height, and pixels of a look, by
which corners of small people are off. Posters in real clips move by 0.03 to 0.2 % of the height, people by 0.3 to 10 %;
pictures 50 to 70 pixels high, filmed by a moving camera, by 0.3 to 1.1 %."""
LOST = 0.1
"""Own motion, heights, of somebody whose corners are all lost while those around him are not; nobody moves more."""

LEAST_SIDE, MOST_SIDE = 112, 256
"""Pixels of a look's side: those of the picture within these bounds, for corners are not followed better in a picture
that was enlarged."""
THINNER, WIDER = 0.02, 0.066
"""Sides of the squares by which the silhouette is eroded and dilated, as a fraction of the look's: corners along its
rim belong to both sides."""
MAX_CORNERS, QUALITY, SPACING = 60, 0.02, 0.02
"""On the silhouette, and as many around it; their least strength against the strongest, and their least distance as a
fraction of the look's side."""
WINDOW, LEVELS = 11, 4
MAX_RETURN_PX = 0.7
"""Forward-backward error beyond which a corner is lost."""
PLANE_PX = 1.0
"""How far a corner of a plane may lie from where the plane has it."""
MIN_INSIDE, MIN_FOLLOWED, MIN_PLANE = 8, 6, 10
"""Corners on the silhouette, those of them that were followed, and corners of which a plane is made."""
IN_VIEW = 0.6
"""Fraction of the corners on the silhouette that must still be in the picture."""
WITH_WALL = 0.25
"""Fraction of the corners around that must lie on a plane of all corners: a body that moves as a whole is none."""
STEADY_AROUND = 0.6
"""Fraction of the corners around that must be followed for those on the silhouette to say something by being lost."""
QUANTILE = 0.75
"""Of the corners' motions: limbs and head move, a trunk may not."""


@dataclass(frozen=True, eq=False, slots=True)
class Look:
    """A person and his surroundings at one time, upright."""

    gray: UInt8[Array, "side side"]
    inside: UInt8[Array, "side side"]
    """On the silhouette."""
    around: UInt8[Array, "side side"]
    """Well outside of it."""
    usable: UInt8[Array, "side side"]
    """Far enough inside the picture."""

    def resized(self, side: int) -> "Look":
        """The same in another size."""
        if side == len(self.gray):
            return self
        gray, *zones = (
            np.asarray(cv2.resize(part, (side, side), interpolation=method), np.uint8)
            for part, method in (
                (self.gray, cv2.INTER_LINEAR), (self.inside, cv2.INTER_NEAREST), (self.around, cv2.INTER_NEAREST),
                (self.usable, cv2.INTER_NEAREST),
            )
        )  # fmt: skip
        return Look(gray, *zones)


def look(picture: Picture, seen: Observation) -> Look:
    """The part of the picture that an observation is about."""
    region = Region(seen.region.x, seen.region.y, seen.region.side)
    side = int(np.clip(round(region.side), LEAST_SIDE, MOST_SIDE))
    to_source = region.to_source(side)
    gray = warp(picture.planes[0], to_source, (side, side))
    scale = side / region.side
    corner = to_source[:, 2]
    low = np.clip(np.ceil(-corner * scale), 0, side).astype(int)
    high = np.clip(np.floor((np.array(picture.size) - corner) * scale), 0, side).astype(int)
    in_picture = np.zeros((side, side), np.uint8)
    in_picture[low[1] : high[1], low[0] : high[0]] = 1
    to_mask = np.vstack([invert(seen.mask_to_source), [0, 0, 1]]) @ np.vstack([to_source, [0, 0, 1]])
    mask = warp(seen.mask, to_mask[:2], (side, side), nearest=True)
    usable = _eroded(in_picture, WINDOW)
    around = (cv2.dilate(mask, _square(round(WIDER * side))) == 0).astype(np.uint8)
    return Look(gray, _eroded(mask, round(THINNER * side)) & usable, around & usable, usable)


def own_motion(before: Look, after: Look) -> float | None:
    """How far what is seen of a person moved by itself between two looks, against what is between pictures and people.

    It is the distance of the corners on him from where a plane has them: that of the corners around him, or of all
    corners if some of those around him lie on it too, whichever explains them better; those that the plane has outside
    the picture do not count. None if he has too few corners to say anything, or nothing could be followed.
    """
    side = len(before.gray)
    after = after.resized(side)
    inside, around = _corners(before.gray, before.inside), _corners(before.gray, before.around)
    if len(inside) < MIN_INSIDE:
        return None
    start = np.concatenate([inside, around])
    end, followed = _follow(before.gray, after.gray, start)
    on_wall = followed & (np.arange(len(start)) >= len(inside))
    height = HEIGHT_OF_SIDE * side
    least = None
    for members in (on_wall, followed):
        plane = None
        if members.sum() >= MIN_PLANE:
            plane, _ = cv2.findHomography(start[members], end[members], cv2.RANSAC, PLANE_PX)
        if plane is None:
            continue
        expected = cv2.perspectiveTransform(start[:, None], plane)[:, 0]
        moved = np.linalg.norm(expected - end, axis=1)
        if on_wall.sum() >= MIN_PLANE and (moved[on_wall] < PLANE_PX).mean() < WITH_WALL:
            continue
        motion = _of_corners(moved[: len(inside)] / height, followed, _is_in(after.usable, expected))
        if motion is not None and (least is None or motion < least):
            least = motion
    return None if least is None else least / float(np.hypot(ALIVE, NOISE_PX / height))


def of_track(own_motions: Collection[float]) -> float | None:
    """What all comparisons of a track say together (their median: one may fail); None without any."""
    return float(np.median(list(own_motions))) if own_motions else None


def _of_corners(
    moved: Float[Array, " inside"], followed: Bool[Array, " n"], visible: Bool[Array, " n"]
) -> float | None:
    """One number of all corners on the silhouette, the first ones; None if it cannot be told."""
    here, there = slice(None, len(moved)), slice(len(moved), None)
    if visible[here].sum() < max(MIN_INSIDE, IN_VIEW * len(moved)):
        return None
    counted = followed[here] & visible[here]
    if counted.sum() >= MIN_FOLLOWED:
        return float(np.quantile(np.minimum(moved[counted], LOST), QUANTILE))
    around = int(visible[there].sum())
    return LOST if around and followed[there][visible[there]].mean() > STEADY_AROUND else None


def _eroded(zone: UInt8[Array, "side side"], by: int) -> UInt8[Array, "side side"]:
    """Without what is near its rim; nothing lies beyond the look."""
    eroded = cv2.erode(zone, _square(by), borderType=cv2.BORDER_CONSTANT, borderValue=0)
    return np.asarray(eroded, np.uint8)


def _square(side: int) -> UInt8[Array, "side side"]:
    return np.ones((max(side, 1), max(side, 1)), np.uint8)


def _is_in(zone: UInt8[Array, "side side"], points: Float[Array, "n 2"]) -> Bool[Array, " n"]:
    cells = np.floor(points).astype(int)
    inside = ((cells >= 0) & (cells < len(zone))).all(axis=1)
    cells = np.clip(cells, 0, len(zone) - 1)
    return np.asarray(inside & (zone[cells[:, 1], cells[:, 0]] > 0))


def _corners(gray: UInt8[Array, "side side"], where: UInt8[Array, "side side"]) -> Float[Array, "n 2"]:
    spacing = max(3.0, SPACING * len(gray))
    found = cv2.goodFeaturesToTrack(gray, MAX_CORNERS, QUALITY, spacing, mask=where)
    return np.zeros((0, 2), np.float32) if found is None else np.asarray(found)[:, 0]


def _follow(
    before: UInt8[Array, "side side"], after: UInt8[Array, "side side"], start: Float[Array, "n 2"]
) -> tuple[Float[Array, "n 2"], Bool[Array, " n"]]:
    """Where corners went, and which of them come back to where they were."""
    there, found = _flow(before, after, start)
    back, found_back = _flow(after, before, there)
    return there, found & found_back & (np.linalg.norm(back - start, axis=1) < MAX_RETURN_PX)


def _flow(
    before: UInt8[Array, "side side"], after: UInt8[Array, "side side"], start: Float[Array, "n 2"]
) -> tuple[Float[Array, "n 2"], Bool[Array, " n"]]:
    there, found, _ = cv2.calcOpticalFlowPyrLK(
        before, after, start[:, None], np.empty_like(start[:, None]), winSize=(WINDOW, WINDOW), maxLevel=LEVELS - 1
    )
    return np.asarray(there)[:, 0], np.asarray(found)[:, 0] > 0
