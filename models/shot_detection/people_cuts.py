"""Cuts that the colours do not show, from the people in a scene (paper section 3.1, parts 2 and 3).

Two views of one room may look alike as a whole, but nobody jumps from one frame to the next. For every pair of
neighbouring frames in which people are seen, each person before is compared with each person after:

* box IoU, as in the paper;
* keypoint IoU: squares of side `_SQUARE` × body size about each landmark that is visible in both frames, their
  intersection over union averaged over the landmarks. Body size is the square root of the box's area. It is 1 for equal
  poses and 0 once most landmarks have moved by a fifth of the body. Each left-right pair may be swapped: a detector
  that mistakes left for right makes no cut.

A cut needs every person to jump (whoever carries on smoothly proves that the camera does too), by far more than these
people usually move in the time between the two frames, calmly before and after, and not back again within `_RETURN_S`
(the detector's own errors). Of those before and those after somebody must be a person: what the detector takes for one
now and then jumps by itself.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from jaxtyping import Float

from humanmm.models.geometry.boxes import box_area, box_iou
from humanmm.models.records.landmarks import HIPS, SHOULDERS, SWAP
from humanmm.models.records.shots import Scenes, Transition
from humanmm.models.records.tracks import PersonTrack, ScenePeople
from humanmm.models.video.frame_times import elapsed_s, nearest_frame

Array = np.ndarray

Parts = Literal["scenes", "boxes", "keypoints"]
"""How much of the three-part detector is used."""

_BOX_IOU = 0.3
"""Boxes of one person in neighbouring frames overlap by more, even running across the picture (0.4, measured)."""
_KEYPOINT_IOU = 0.3
"""Keypoints of one person overlap by more unless the detector errs; across cuts 0 to 0.3."""
_SQUARE = 0.2
"""Side of a keypoint's square as a fraction of the body's size: a few times the detector's jitter (0.02)."""
_TIMES_USUAL = 6.0
"""A jump is so many times larger than the person's usual movement nearby, in the same time."""
_USUAL_S = 0.4
"""How far on either side the usual movement is taken from."""
_CALM_STEPS = 3
"""Steps that must be known on either side."""
_GAP_S = 0.15
"""Longest time for which a tracker may lose everybody at a cut."""
_RETURN_S = 0.255
"""A jump that is undone within this time (8 frames at 30 Hz) is an error of the detector."""
_VISIBLE = 0.5
"""Visibility from which on a landmark is compared."""
_PEOPLE = 0.5
"""Least probability that somebody on either side is a person, the two taken as independent."""
_MIN_CONFIDENCE = 0.3
"""Sightings of lower confidence are left out."""
_MIN_LANDMARKS = 8
"""Landmarks that must be visible in both frames."""
_STILL = 0.02
"""Least usual movement a frame, fraction of the body's size: the detector's jitter."""


@dataclass(frozen=True)
class Step:
    """How two sightings of a person differ."""

    box_iou: float
    keypoint_iou: float
    distance: float
    """Median movement of the visible landmarks (of the better labelling), fraction of the body's size."""


def split_scenes(
    scenes: Scenes, people: Sequence[ScenePeople | None], *, time_s: Float[Array, " F"], parts: Parts = "keypoints"
) -> tuple[Transition, ...]:
    """All transitions of the video: those of the colours, then those that people show inside the scenes.

    `time_s` holds the presentation times of all frames.
    """
    if parts == "scenes":
        return scenes.transitions
    with_keypoints = parts == "keypoints"
    seen = [scene for scene in people if scene is not None]
    found = [cut for scene in seen for cut in cuts_in_scene(scene, time_s=time_s, with_keypoints=with_keypoints)]
    free = [cut for cut in found if not any(t.start <= cut.start <= t.end for t in scenes.transitions)]
    return tuple(sorted([*scenes.transitions, *free], key=lambda t: t.start))


def cuts_in_scene(scene: ScenePeople, *, time_s: Float[Array, " F"], with_keypoints: bool = True) -> list[Transition]:
    """Cuts inside one scene, in order. Without keypoints only boxes that jump make a cut; what speaks against a jump
    (movement that is usual, a jump that is undone) is looked for all the same."""
    tracks = [_Sightings(track, time_s) for track in scene.tracks]
    frames = sorted({frame for track in tracks for frame in track.row})
    cuts: list[Transition] = []
    for before, after in pairwise(frames):
        if after - before > 1 and elapsed_s(time_s, before, after) > _GAP_S:
            continue
        evidence = _evidence(tracks, before, after, time_s)
        if evidence == "bbox" or (evidence == "keypoints" and with_keypoints):
            # a tracker loses everybody at the cut and finds them again some frames later
            cuts.append(Transition("cut", before + 1, before + 1, evidence))
    return cuts


def _evidence(tracks: Sequence["_Sightings"], before: int, after: int, time_s: Float[Array, " F"]) -> str | None:
    """Which comparison, box or keypoints, shows that a cut lies between two frames; None if there is no cut."""
    # who is lost for a while, or found again, is no evidence: only who goes on, ends or begins here
    leaving = [t for t in tracks if before in t.row and (after in t.row or t.last == before)]
    arriving = [t for t in tracks if after in t.row and (before in t.row or t.first == after)]
    steps = [step(a, before, b, after) for a in leaving for b in arriving]
    if any(s is None for s in steps):
        return None
    known = [s for s in steps if s is not None]
    if not known:
        return None
    boxes_jump = all(s.box_iou < _BOX_IOU for s in known)
    keypoints_jump = all(s.keypoint_iou < _KEYPOINT_IOU for s in known)
    if not (boxes_jump or keypoints_jump):
        return None
    jump = min(s.distance for s in known)
    # both sides need somebody who was, and is, seen to move calmly
    usual = [
        [(t.probability, speed) for t in side if (speed := t.usual_speed(at, within_s)) is not None]
        for side, at, within_s in ((leaving, before, -_USUAL_S), (arriving, after, _USUAL_S))
    ]
    if not all(usual) or math.prod(max(probability for probability, _ in side) for side in usual) < _PEOPLE:
        return None
    moved = elapsed_s(time_s, before, after) * max(speed for side in usual for _, speed in side)
    if jump < _TIMES_USUAL * max(_STILL * (after - before), moved):
        return None
    if _returns(tracks, before, after, time_s):
        return None
    return "bbox" if boxes_jump else "keypoints"


def _returns(tracks: Sequence["_Sightings"], before: int, after: int, time_s: Float[Array, " F"]) -> bool:
    """Whether somebody is soon back where they were, or comes back from a jump shortly before."""
    there = [(before, later) for later in range(after, nearest_frame(time_s, time_s[after] + _RETURN_S) + 1)]
    back = [(earlier, after) for earlier in range(nearest_frame(time_s, time_s[before] - _RETURN_S), before)]
    return any(
        _carries_on(step(old, first, new, second))
        for first, second in there + back
        for old in tracks
        if first in old.row
        for new in tracks
        if second in new.row
    )


def _carries_on(change: Step | None) -> bool:
    return change is not None and change.keypoint_iou > _KEYPOINT_IOU and change.box_iou > _BOX_IOU


def step(a: "_Sightings", frame_a: int, b: "_Sightings", frame_b: int) -> Step | None:
    """Difference between a sighting in one frame and one in another.

    None if too few landmarks are visible in both, or if the body is upside down in one: no camera does that at a cut,
    but detectors do.
    """
    i, j = a.row[frame_a], b.row[frame_b]
    size = float(np.sqrt(a.size[i] * b.size[j]))
    first, second = a.keypoints[i], b.keypoints[j]
    seen = (first[:, 2] > _VISIBLE) & (second[:, 2] > _VISIBLE)
    if seen.sum() < _MIN_LANDMARKS or _trunk(first) @ _trunk(second) < 0:
        return None
    squares, squares_labelled, squares_swapped = (
        _squares(points, _SQUARE * size) for points in (first, second, second[SWAP])
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


class _Sightings:
    """The trustworthy part of a track, looked up by frame."""

    def __init__(self, track: PersonTrack, time_s: Float[Array, " F"]) -> None:
        self._time_s = time_s
        self._frame_s = float(np.median(np.diff(time_s)))
        self.probability = track.probability
        self.row = {int(f): i for i, f in enumerate(track.frame) if track.confidence[i] >= _MIN_CONFIDENCE}
        self.first, self.last = min(self.row, default=-1), max(self.row, default=-1)
        self.keypoints = track.keypoints2d.astype(np.float64)
        self.boxes = track.bbox.astype(np.float64)
        self.size = np.sqrt(np.maximum(box_area(self.boxes), 1.0))
        self._frames = np.array(sorted(self.row), dtype=np.int64)

    def usual_speed(self, frame: int, within_s: float) -> float | None:
        """Upper quartile of the movement a second within some seconds before (negative) or after a frame.

        The steps next to the frame count in full: a jump among jumps is a detector that errs. None where too few steps
        are known.
        """
        other = nearest_frame(self._time_s, self._time_s[frame] + within_s)
        other = min(other, frame - _CALM_STEPS) if within_s < 0 else max(other, frame + _CALM_STEPS)
        speeds = list(self._speeds(frame, other))
        if len(speeds) < _CALM_STEPS:
            return None
        return max(float(np.quantile(speeds, 0.75)), 0.5 * max(speeds[:2]))

    def _speeds(self, frame: int, other: int) -> Iterator[float]:
        """Movement a second between two frames, the steps nearest to `frame` first.

        A body rotated upside down moves by its whole size a frame. Steps shorter than the video's usual ones show the
        detector's jitter rather than motion, and count as long as those.
        """
        inside = self._frames[(self._frames >= min(frame, other)) & (self._frames <= max(frame, other))]
        pairs = list(zip(inside[:-1].tolist(), inside[1:].tolist(), strict=True))
        for one, next_one in pairs if other > frame else reversed(pairs):
            change = step(self, one, self, next_one)
            if change is None:
                yield 1.0 / self._frame_s
            else:
                yield change.distance / max(elapsed_s(self._time_s, one, next_one), self._frame_s)
