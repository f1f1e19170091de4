"""Cuts that the colours do not show, from the people in a scene (paper section 3.1, parts 2 and 3).

Two views of one room may look alike as a whole, but nobody jumps from one frame to the next. For every pair of
neighbouring frames in which people are seen, each person before is compared with each person after:

* box IoU, as in the paper;
* keypoint IoU: squares of side `_SQUARE` × body size about each landmark that is visible in both frames, their
  intersection over union averaged over the landmarks. Body size is the square root of the box's area. It is 1 for equal
  poses and 0 once most landmarks have moved by a fifth of the body. Each left-right pair may be exchanged: a detector
  that mistakes left for right makes no cut.

A cut needs every person to jump (whoever carries on smoothly proves that the camera does too), by far more than these
people usually move, calmly before and after, and not back again within `_RETURN_S` (the detector's own slips).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from humanmm.models.records.landmarks import HIPS, SHOULDERS, SWAP
from humanmm.models.records.shots import Scenes, Transition
from humanmm.models.records.tracks import PersonTrack, ScenePeople

Parts = Literal["scenes", "boxes", "keypoints"]
"""How much of the three-part detector is used."""

_BOX_IOU = 0.3
"""Boxes of one person in neighbouring frames overlap by more, even running across the picture (0.4, measured)."""
_KEYPOINT_IOU = 0.3
"""Keypoints of one person overlap by more unless the detector slips; across cuts 0 to 0.3."""
_SQUARE = 0.2
"""Side of a keypoint's square as a share of the body's size: a few times the detector's jitter (0.02)."""
_TIMES_USUAL = 6.0
"""A jump is so many times larger than the person's usual movement from frame to frame nearby."""
_USUAL_S = 0.4
"""How far on either side the usual movement is taken from, seconds."""
_CALM_STEPS = 3
"""Steps that must be known on either side."""
_GAP_S = 0.15
"""Longest time for which a tracker may lose everybody at a cut."""
_RETURN_S = 0.25
"""A jump that is undone within this time is a slip of the detector."""
_VISIBLE = 0.5
"""Visibility from which on a landmark is compared."""
_MIN_CONFIDENCE = 0.3
"""Less trusted sightings are not looked at."""
_MIN_LANDMARKS = 8
"""Landmarks that must be visible in both frames."""
_STILL = 0.02
"""Least usual movement, share of the body's size: the detector's jitter."""


@dataclass(frozen=True)
class Step:
    """How two sightings of a person differ."""

    box_iou: float
    keypoint_iou: float
    distance: float
    """Median movement of the visible landmarks (of the better labelling), share of the body's size."""


def split_scenes(
    scenes: Scenes, people: Sequence[ScenePeople | None], *, fps: float, parts: Parts = "keypoints"
) -> tuple[Transition, ...]:
    """All transitions of the video: those of the colours, then those that people show inside the scenes."""
    if parts == "scenes":
        return scenes.transitions
    with_keypoints = parts == "keypoints"
    inside = [cuts_in_scene(scene, fps=fps, with_keypoints=with_keypoints) for scene in people if scene is not None]
    found = [cut for cuts in inside for cut in cuts]
    free = [cut for cut in found if not any(t.start <= cut.start <= t.end for t in scenes.transitions)]
    return tuple(sorted([*scenes.transitions, *free], key=lambda t: t.start))


def cuts_in_scene(scene: ScenePeople, *, fps: float, with_keypoints: bool = True) -> list[Transition]:
    """Cuts inside one scene, in order. Without keypoints only boxes that jump make a cut; what speaks against a jump
    (movement that is usual, a jump that is undone) is looked for all the same."""
    tracks = [_Sightings(track) for track in scene.tracks]
    frames = sorted({frame for track in tracks for frame in track.row})
    cuts: list[Transition] = []
    for before, after in pairwise(frames):
        if after - before > max(1.0, _GAP_S * fps):
            continue
        evidence = _evidence(tracks, before, after, fps)
        if evidence == "bbox" or (evidence == "keypoints" and with_keypoints):
            # a tracker loses everybody at the cut and finds them again some frames later
            cuts.append(Transition("cut", before + 1, before + 1, evidence))
    return cuts


def _evidence(tracks: Sequence["_Sightings"], before: int, after: int, fps: float) -> str | None:
    """Which comparison, box or keypoints, says that a cut lies between two frames; None if there is no cut."""
    # who is lost for a while, or found again, says nothing: only who goes on, ends or begins here
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
    reach = max(_CALM_STEPS, round(_USUAL_S * fps))
    usual = [t.usual_movement(before, -reach) for t in leaving] + [t.usual_movement(after, reach) for t in arriving]
    # both sides need somebody who was, and is, seen to move calmly
    if all(u is None for u in usual[: len(leaving)]) or all(u is None for u in usual[len(leaving) :]):
        return None
    if jump < _TIMES_USUAL * max([_STILL, *(u for u in usual if u is not None)]) * (after - before):
        return None
    if _returns(tracks, before, after, round(_RETURN_S * fps)):
        return None
    return "bbox" if boxes_jump else "keypoints"


def _returns(tracks: Sequence["_Sightings"], before: int, after: int, reach: int) -> bool:
    """Whether somebody is soon back where they were, or comes back from a jump shortly before."""
    there = [(before, later) for later in range(after, after + reach + 1)]
    back = [(earlier, after) for earlier in range(before - reach, before)]
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
    as_labelled = square_iou(first[:, :2], second[:, :2], _SQUARE * size)
    exchanged = square_iou(first[:, :2], second[SWAP, :2], _SQUARE * size)
    # a pair of landmarks is exchanged as a whole
    swap = exchanged + exchanged[SWAP] > as_labelled + as_labelled[SWAP]
    overlap = np.where(swap, exchanged, as_labelled)
    moved = np.linalg.norm(second[:, :2] - first[:, :2], axis=1)
    moved_exchanged = np.linalg.norm(second[SWAP, :2] - first[:, :2], axis=1)
    shorter = moved_exchanged + moved_exchanged[SWAP] < moved + moved[SWAP]
    distance = np.where(shorter, moved_exchanged, moved)
    return Step(
        box_iou=box_iou(a.boxes[i], b.boxes[j]),
        keypoint_iou=float(overlap[seen].mean()),
        distance=float(np.median(distance[seen])) / size,
    )


def _trunk(keypoints: np.ndarray) -> np.ndarray:
    """(2,) from the hips to the shoulders."""
    return np.asarray(keypoints[list(SHOULDERS), :2].mean(axis=0) - keypoints[list(HIPS), :2].mean(axis=0))


def box_iou(a: np.ndarray, b: np.ndarray) -> float:
    """Intersection over union of two boxes xyxy."""
    inner = np.clip(np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2]), 0, None).prod()
    union = (a[2:] - a[:2]).prod() + (b[2:] - b[:2]).prod() - inner
    return float(inner / union) if union > 0 else 0.0


def square_iou(a: np.ndarray, b: np.ndarray, side: float) -> np.ndarray:
    """(N,) intersection over union of squares of one side about points (N,2) and (N,2)."""
    inner = np.clip(side - np.abs(a - b), 0, None).prod(axis=-1)
    return np.asarray(inner / (2 * side * side - inner))


class _Sightings:
    """The trustworthy part of a track, looked up by frame."""

    def __init__(self, track: PersonTrack) -> None:
        self.row = {int(f): i for i, f in enumerate(track.frame) if track.confidence[i] >= _MIN_CONFIDENCE}
        self.first, self.last = min(self.row, default=-1), max(self.row, default=-1)
        self.keypoints = track.keypoints2d.astype(np.float64)
        self.boxes = track.bbox.astype(np.float64)
        self.size = np.sqrt(np.maximum((self.boxes[:, 2:] - self.boxes[:, :2]).prod(axis=1), 1.0))
        self._frames = np.array(sorted(self.row), dtype=np.int64)

    def usual_movement(self, frame: int, reach: int) -> float | None:
        """Upper quartile of the movement a frame within `reach` frames before (negative) or after a frame.

        The steps next to the frame count in full: a jump among jumps is a detector that slips.
        """
        moves = list(self._moves(frame, reach))
        if len(moves) < _CALM_STEPS:
            return None
        return max(float(np.quantile(moves, 0.75)), 0.5 * max(moves[:2]))

    def _moves(self, frame: int, reach: int) -> Iterator[float]:
        """Movement a frame, the steps nearest to `frame` first; a body turned upside down moves by its whole size."""
        low, high = min(frame, frame + reach), max(frame, frame + reach)
        inside = self._frames[(self._frames >= low) & (self._frames <= high)]
        pairs = list(zip(inside[:-1].tolist(), inside[1:].tolist(), strict=True))
        for one, other in pairs if reach > 0 else reversed(pairs):
            move = step(self, one, self, other)
            yield 1.0 if move is None else move.distance / (other - one)
