"""Cuts that the colours do not show, from the people in a scene (paper section 3.1, parts 2 and 3).

Two views of one room may look alike as a whole, but nobody jumps from one frame to the next. For every pair of
successive looks in which people are seen, each person before is compared with each person after:

* box IoU, as in the paper;
* keypoint IoU: squares of side `sightings.SQUARE` × body size about each landmark that is visible in both looks, their
  intersection over union averaged over the landmarks. Body size is the square root of the box's area. It is 1 for equal
  poses and 0 once most landmarks have moved by a fifth of the body. Each left-right pair may be swapped: a detector
  that mistakes left for right makes no cut.

A cut needs every person to jump (whoever carries on smoothly proves that the camera does too), by far more than these
people usually move in the time between the two looks, calmly before and after, and not back again within `_RETURN_S`
(the detector's own errors). Of those before and those after somebody must be a person: what the detector takes for one
now and then jumps by itself.

Where frames lie between the two looks, the cut is at the one at which the picture changes most, if it does at any.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float

from humanmm.models.records.shots import Change, Scenes, Transition
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.shot_detection.corrected_cuts import NEAR_FRAMES, distance
from humanmm.models.shot_detection.leaps import leaps
from humanmm.models.shot_detection.sightings import USUAL_S, Sightings, Step, looks_at, step
from humanmm.models.video.frame_times import elapsed_s, nearest_frame

Array = np.ndarray

Parts = Literal["scenes", "boxes", "keypoints"]
"""How much of the three-part detector is used."""

_BOX_IOU = 0.3
"""Boxes of one person in successive looks overlap by more, even running across the picture (0.4, measured)."""
_KEYPOINT_IOU = 0.3
"""Keypoints of one person overlap by more unless the detector errs; across cuts 0 to 0.3."""
_TIMES_USUAL = 6.0
"""A jump is so many times larger than the person's usual movement nearby, in the same time."""
_GAP_S = 0.15
"""Longest time for which a tracker may lose everybody at a cut."""
_RETURN_S = 0.255
"""A jump that is undone within this time (8 frames at 30 Hz) is an error of the detector."""
_PEOPLE = 0.5
"""Least probability that somebody on either side is a person, the two taken as independent."""
_STILL = 0.02
"""Least usual movement a look, fraction of the body's size: the detector's jitter."""


class Split(NamedTuple):
    """Where the shots of a video change."""

    transitions: tuple[Transition, ...]
    """In order: those of the colours, and those that people show inside the scenes."""
    suspected: tuple[int, ...]
    """Frames besides that may begin a shot."""


def split_scenes(
    scenes: Scenes, people: Sequence[ScenePeople | None], *, time_s: Float[Array, " F"], parts: Parts = "keypoints"
) -> Split:
    """All transitions of the video. `time_s` holds the presentation times of all frames."""
    if parts == "scenes":
        return Split(scenes.transitions, scenes.suspected)
    with_keypoints = parts == "keypoints"
    seen = [scene for scene in people if scene is not None]
    found = [
        cut
        for scene in seen
        for cut in cuts_in_scene(scene, time_s=time_s, changes=scenes.changes, with_keypoints=with_keypoints)
    ]
    transitions = [
        *scenes.transitions,
        *(cut for cut in found if all(distance(t, cut.start) > 0 for t in scenes.transitions)),
    ]
    leaping = [
        leap
        for leap in (leaps(scenes, seen, time_s=time_s) if with_keypoints else ())
        if all(distance(t, leap.frame) > NEAR_FRAMES for t in transitions)
    ]
    transitions += [Transition("cut", leap.frame, leap.frame, "keypoints") for leap in leaping if leap.certain]
    suspected = {*scenes.suspected, *(leap.frame for leap in leaping if not leap.certain)}
    return Split(tuple(sorted(transitions, key=lambda t: t.start)), tuple(sorted(suspected)))


def cuts_in_scene(
    scene: ScenePeople, *, time_s: Float[Array, " F"], changes: Sequence[Change] = (), with_keypoints: bool = True
) -> list[Transition]:
    """Cuts inside one scene, in order; `changes`: where the picture changes most. Without keypoints only boxes that
    jump make a cut; what speaks against a jump (movement that is usual, a jump that is undone) is looked for all the
    same."""
    looks = looks_at(scene, len(time_s))
    look_s = time_s[looks]
    tracks = [Sightings(track, looks, look_s) for track in scene.tracks]
    cuts: list[Transition] = []
    for before, after in pairwise(sorted({look for track in tracks for look in track.row})):
        if after - before > 1 and elapsed_s(look_s, before, after) > _GAP_S:
            continue
        evidence = _evidence(tracks, before, after, look_s)
        if evidence == "bbox" or (evidence == "keypoints" and with_keypoints):
            # a tracker loses everybody at the cut and finds them again some looks later
            frame = _first_after(int(looks[before]), int(looks[before + 1]), changes)
            cuts.append(Transition("cut", frame, frame, evidence))
    return cuts


def _first_after(before: int, after: int, changes: Sequence[Change]) -> int:
    """The first frame after a cut between two frames: where the picture changes most, or else in the middle."""
    between = [change for change in changes if before < change.frame <= after]
    if between:
        return max(between, key=lambda change: change.outstanding).frame
    return before + (after - before) // 2 + 1


def _evidence(tracks: Sequence[Sightings], before: int, after: int, look_s: Float[Array, " L"]) -> str | None:
    """Which comparison, box or keypoints, shows that a cut lies between two looks; None if there is no cut."""
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
        for side, at, within_s in ((leaving, before, -USUAL_S), (arriving, after, USUAL_S))
    ]
    if not all(usual) or math.prod(max(probability for probability, _ in side) for side in usual) < _PEOPLE:
        return None
    moved = elapsed_s(look_s, before, after) * max(speed for side in usual for _, speed in side)
    if jump < _TIMES_USUAL * max(_STILL * (after - before), moved):
        return None
    if _returns(tracks, before, after, look_s):
        return None
    return "bbox" if boxes_jump else "keypoints"


def _returns(tracks: Sequence[Sightings], before: int, after: int, look_s: Float[Array, " L"]) -> bool:
    """Whether somebody is soon back where they were, or comes back from a jump shortly before."""
    there = [(before, later) for later in range(after, nearest_frame(look_s, look_s[after] + _RETURN_S) + 1)]
    back = [(earlier, after) for earlier in range(nearest_frame(look_s, look_s[before] - _RETURN_S), before)]
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
