"""The background: point tracks without what lies on people (paper section 3.2: visibility 0 inside the person mask).

A tracked point feels everything under its window, so a mask is widened by half that window before points are tested.
Where a person is missed for some frames but tracked on both sides, the neighbours' masks are carried over the hole.
"""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.records.camera import PointTracks
from humanmm.models.records.shots import Box
from humanmm.models.records.tracks import MASK_SIDE, PersonTrack
from humanmm.models.video.progress import Progress, silent

HELD_FRAMES = 5
"""Frames for which a mask is held before a person's first and after the last observation."""
MASK_ERROR_FRACTION = 0.015
"""Expected error of a silhouette, as a fraction of the crop's side."""
MAX_MASKED_FRACTION = 0.4
"""A track with a larger fraction of its observations on people is taken for a point of a person."""


def background_points(
    points: PointTracks, people: Sequence[PersonTrack], *, progress: Progress = silent
) -> PointTracks:
    """The observations that lie on nobody; a track interrupted by a person goes on under a new number.

    A track that spends much of its life on people is dropped whole: its other observations are most likely a
    silhouette's edge.
    """
    masked = np.zeros(len(points.frame), bool)
    frames, first = np.unique(points.frame, return_index=True)
    ends = np.append(first, len(points.frame))[1:]
    people = [person for person in people if len(person.frame)]
    for done, (frame, begin, stop) in enumerate(zip(frames, first, ends, strict=True), start=1):
        for person in people:
            masked[begin:stop] |= _on_person(person, int(frame), points.xy[begin:stop], points.window_px)
        progress(done, len(frames))
    return _without(points, masked, mostly=MAX_MASKED_FRACTION)


def without_burned_in(points: PointTracks, boxes: Sequence[Box]) -> PointTracks:
    """The observations outside boxes in which something is drawn over the film: whatever moves there, it is not the
    camera."""
    masked, margin = np.zeros(len(points.frame), bool), points.window_px / 2
    for box in boxes:
        masked |= ((points.xy > np.array(box[:2]) - margin) & (points.xy < np.array(box[2:]) + margin)).all(axis=1)
    return _without(points, masked, mostly=1.0)


def _on_person(
    person: PersonTrack, frame: int, xy: Float[np.ndarray, "n 2"], window_px: float
) -> Bool[np.ndarray, " n"]:
    after = int(np.searchsorted(person.frame, frame))
    if after < len(person.frame) and person.frame[after] == frame:
        return _inside(person.masks.mask(after), person.mask_affine[after], person.bbox[after], xy, window_px)
    before = after - 1
    if before >= 0 and after < len(person.frame):
        share = (frame - person.frame[before]) / (person.frame[after] - person.frame[before])
        affine = (1 - share) * person.mask_affine[before] + share * person.mask_affine[after]
        bbox = (1 - share) * person.bbox[before] + share * person.bbox[after]
        mask = person.masks.mask(before) | person.masks.mask(after)
        return _inside(mask, affine, bbox, xy, window_px)
    end = min(max(after, 0), len(person.frame) - 1)
    if abs(int(person.frame[end]) - frame) > HELD_FRAMES:
        return np.zeros(len(xy), bool)
    return _inside(person.masks.mask(end), person.mask_affine[end], person.bbox[end], xy, window_px)


def _inside(
    mask: np.ndarray, affine: np.ndarray, bbox_xyxy: np.ndarray, xy: np.ndarray, window_px: float
) -> Bool[np.ndarray, " n"]:
    """Which points lie in the widened mask; the whole box stands in for a mask that is empty."""
    linear = affine[:, :2].astype(float)
    px_per_mask_px = float(np.sqrt(abs(np.linalg.det(linear))))
    if not mask.any() or px_per_mask_px < 1e-6:
        margin = window_px / 2
        low, high = bbox_xyxy[:2] - margin, bbox_xyxy[2:] + margin
        return np.asarray(((xy >= low) & (xy <= high)).all(1))
    radius = window_px / 2 / px_per_mask_px + MASK_ERROR_FRACTION * MASK_SIDE
    cell = np.floor(np.linalg.solve(linear, (xy - affine[:, 2]).T).T).astype(int)
    return _near(mask, cell, round(radius))


def _near(mask: np.ndarray, cell: np.ndarray, radius: int) -> Bool[np.ndarray, " n"]:
    """Which cells (column, row) lie in a mask widened by OpenCV's ellipse of a radius in cells.

    Only the given points are looked at, a row of the ellipse at a time by sums along the mask's rows: a person who is
    small in the picture has the mask widened by half its side, which takes seconds a frame for the whole of it.
    """
    height, width = mask.shape
    side = 2 * radius + 1
    reach = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)).sum(1, dtype=int) // 2
    set_before = np.zeros((height + 1, width + 1), np.int32)  # one more row, of which nothing is set
    np.cumsum(mask > 0, axis=1, out=set_before[:height, 1:])
    row = cell[:, 1:] + np.arange(-radius, radius + 1)
    row = np.where((row >= 0) & (row < height), row, height)
    first, end = np.clip(cell[:, :1] - reach, 0, width), np.clip(cell[:, :1] + reach + 1, 0, width)
    return np.asarray((set_before[row, end] > set_before[row, first]).any(1))


def _without(points: PointTracks, masked: Bool[np.ndarray, " m"], *, mostly: float) -> PointTracks:
    """Drop masked observations, split the tracks they interrupt, drop tracks masked for more than the fraction
    `mostly`."""
    if not masked.any():
        return points
    order = np.lexsort((points.frame, points.track))
    track, hidden = points.track[order], masked[order]
    begins = np.concatenate([[True], (track[1:] != track[:-1]) | (hidden[1:] != hidden[:-1])])
    piece = np.empty(len(track), np.int32)
    piece[order] = np.cumsum(begins) - 1
    length = np.bincount(points.track)
    share = np.bincount(points.track, masked, minlength=len(length)) / np.maximum(length, 1)
    keep = ~masked & (share[points.track] <= mostly)
    return replace(
        points, track=piece[keep], frame=points.frame[keep], xy=points.xy[keep], confidence=points.confidence[keep]
    )
