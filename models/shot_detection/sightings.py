"""Sightings of a person in successive looks, and how they differ."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from humanmm.models.geometry.boxes import box_iou, box_size
from humanmm.models.records.landmarks import HIPS, SHOULDERS, SWAP, VISIBLE
from humanmm.models.records.tracks import PersonTrack, ScenePeople
from humanmm.models.video.frame_times import elapsed_s, nearest_frame

Array = np.ndarray

SQUARE = 0.2
"""Side of a keypoint's square as a fraction of the body's size: a few times the detector's jitter (0.02)."""
USUAL_S = 0.4
"""How far on either side the usual movement is taken from."""
_CALM_STEPS = 3
"""Steps that must be known on either side."""
_MIN_CONFIDENCE = 0.3
"""Sightings of lower confidence are left out."""
_MIN_LANDMARKS = 8
"""Landmarks that must be visible in both looks."""


@dataclass(frozen=True)
class Step:
    """How two sightings of a person differ."""

    box_iou: float
    keypoint_iou: float
    distance: float
    """Median movement of the visible landmarks (of the better labelling), fraction of the body's size."""


def looks_at(scene: ScenePeople, num_frames: int) -> Int[Array, " L"]:
    """The frames in which the people of a scene were looked at; all of the video where no frame was left out."""
    return np.arange(num_frames) if scene.looks is None else scene.looks.astype(np.int64)


class Sightings:
    """The trustworthy part of what was seen of somebody, by look; what is interpolated between two looks is no part of
    it. `looks` are the frames that were looked at, `look_s` (L,) their times."""

    def __init__(self, track: PersonTrack, looks: Int[Array, " L"], look_s: Float[Array, " L"]) -> None:
        self._look_s = look_s
        self.step_s = float(np.median(np.diff(look_s)))
        """Seconds from one look to the next."""
        self.probability = track.probability
        rows = np.flatnonzero(np.isin(track.frame, looks) & (track.confidence >= _MIN_CONFIDENCE))
        self.row = dict(zip(np.searchsorted(looks, track.frame[rows]).tolist(), rows.tolist(), strict=True))
        self.first, self.last = min(self.row, default=-1), max(self.row, default=-1)
        self.keypoints = track.keypoints2d.astype(np.float64)
        self.boxes = track.bbox.astype(np.float64)
        self.size = box_size(self.boxes)
        self.looks = np.array(sorted(self.row), dtype=np.int64)
        """(N,) the looks in which he is seen well, in order; `row` says where each stands in the arrays."""

    def usual_speed(self, look: int, within_s: float) -> float | None:
        """Upper quartile of the movement a second within some seconds before (negative) or after a look.

        The steps next to the look count in full: a jump among jumps is a detector that errs. None where too few steps
        are known.
        """
        other = nearest_frame(self._look_s, self._look_s[look] + within_s)
        other = min(other, look - _CALM_STEPS) if within_s < 0 else max(other, look + _CALM_STEPS)
        speeds = list(self._speeds(look, other))
        if len(speeds) < _CALM_STEPS:
            return None
        return max(float(np.quantile(speeds, 0.75)), 0.5 * max(speeds[:2]))

    def _speeds(self, look: int, other: int) -> Iterator[float]:
        """Movement a second between two looks, the steps nearest to `look` first.

        A body rotated upside down moves by its whole size a look. Steps shorter than the usual ones show the detector's
        jitter rather than motion, and count as long as those.
        """
        inside = self.looks[(self.looks >= min(look, other)) & (self.looks <= max(look, other))]
        pairs = list(zip(inside[:-1].tolist(), inside[1:].tolist(), strict=True))
        for one, next_one in pairs if other > look else reversed(pairs):
            change = step(self, one, self, next_one)
            if change is None:
                yield 1.0 / self.step_s
            else:
                yield change.distance / max(elapsed_s(self._look_s, one, next_one), self.step_s)


def step(a: "Sightings", look_a: int, b: "Sightings", look_b: int) -> Step | None:
    """Difference between a sighting in one look and one in another.

    None if too few landmarks are visible in both, or if the body is upside down in one: no camera does that at a cut,
    but detectors do.
    """
    i, j = a.row[look_a], b.row[look_b]
    size = float(np.sqrt(a.size[i] * b.size[j]))
    first, second = a.keypoints[i], b.keypoints[j]
    seen = (first[:, 2] > VISIBLE) & (second[:, 2] > VISIBLE)
    if seen.sum() < _MIN_LANDMARKS or _trunk(first) @ _trunk(second) < 0:
        return None
    squares, squares_labelled, squares_swapped = (
        _squares(points, SQUARE * size) for points in (first, second, second[SWAP])
    )
    as_labelled, swapped = box_iou(squares, squares_labelled), box_iou(squares, squares_swapped)
    # a pair of landmarks is swapped as a whole
    better_swapped = swapped + swapped[SWAP] > as_labelled + as_labelled[SWAP]
    overlap = np.where(better_swapped, swapped, as_labelled)
    moved = np.linalg.norm(second[:, :2] - first[:, :2], axis=1)
    moved_swapped = np.linalg.norm(second[SWAP, :2] - first[:, :2], axis=1)
    shorter = moved_swapped + moved_swapped[SWAP] < moved + moved[SWAP]
    distance = np.where(shorter, moved_swapped, moved)
    return Step(
        box_iou=float(box_iou(a.boxes[i], b.boxes[j])),
        keypoint_iou=float(overlap[seen].mean()),
        distance=float(np.median(distance[seen])) / size,
    )


def _trunk(keypoints: np.ndarray) -> np.ndarray:
    """(2,) from the hips to the shoulders."""
    return np.asarray(keypoints[list(SHOULDERS), :2].mean(axis=0) - keypoints[list(HIPS), :2].mean(axis=0))


def _squares(keypoints: Float[Array, "33 3"], side: float) -> Float[Array, "33 4"]:
    """xyxy of squares of one side about keypoints."""
    return np.concatenate([keypoints[:, :2] - side / 2, keypoints[:, :2] + side / 2], axis=1)
