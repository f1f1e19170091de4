"""The part of a scene's point tracks that belongs to one shot: points are tracked before the cuts that people show are
known."""

from dataclasses import replace

import numpy as np
from jaxtyping import Int

from humanmm.models.camera.masking import without_burned_in
from humanmm.models.records.camera import PointTracks
from humanmm.models.records.shots import Shot


def points_of_shot(points: PointTracks, shot: Shot) -> PointTracks:
    """The tracks of a scene within one of its shots, in the clear frames and on nothing that is burned in."""
    return without_burned_in(without_transitions(within(points, shot.start, shot.end), shot.clear), shot.burned_in)


def without_transitions(points: PointTracks, clear: tuple[int, int]) -> PointTracks:
    """The observations in the clear frames [start, end) of a shot, the first and the last of which have some; beside
    them two places are seen at once, or nothing. All observations if none would be left."""
    if not ((points.frame >= clear[0]) & (points.frame < clear[1])).any():
        return points
    return replace(within(points, *clear), start=points.start, end=points.end)


def within(points: PointTracks, start: int, end: int) -> PointTracks:
    """The tracks of a scene within one of its shots, [start, end).

    A first or last frame that was not recorded gets the observations of the last recorded one before it: the picture
    stood still since (where it changed at once, the tracker records both sides of the change).
    """
    if (start, end) == (points.start, points.end):
        return points
    first, last = np.searchsorted(points.frame, [start, end])
    parts = [(np.arange(first, last), points.frame[first:last])]
    if start not in parts[0][1]:
        parts.insert(0, _held(points, start))
    if end - 1 > start and end - 1 not in parts[-1][1]:
        parts.append(_held(points, end - 1))
    index = np.concatenate([index for index, _ in parts])
    return replace(
        points,
        start=start,
        end=end,
        track=points.track[index],
        frame=np.concatenate([frame for _, frame in parts]),
        xy=points.xy[index],
        confidence=points.confidence[index],
    )


def _held(points: PointTracks, frame: int) -> tuple[Int[np.ndarray, " n"], Int[np.ndarray, " n"]]:
    """The observations of the last frame recorded before this one, and this frame's number for each."""
    last = int(np.searchsorted(points.frame, frame))
    first = int(np.searchsorted(points.frame, points.frame[last - 1])) if last else 0
    return np.arange(first, last), np.full(last - first, frame, np.int32)
