"""How far the detector's answers lie from the truth, person by person and shot by shot.

The truth is a body with landmarks (rendered clips) or joints alone (real clips, twelve limbs). Lengths in the picture
are shares of the person's height as a standing person would have it there: stature · focal length / depth.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int

from humanmm.models.evaluation.skeleton import LIMB_NAMES, pick
from humanmm.models.geometry.alignment import kabsch
from humanmm.models.geometry.projection import project, ray_axes, world_to_camera
from humanmm.models.geometry.rotations import rotmat_to_rotvec
from humanmm.models.records import landmarks
from humanmm.models.records.sequence import CameraSequence, MotionSequence, PersonSequence
from humanmm.models.records.tracks import PersonTrack, ScenePeople
from humanmm.models.synthetic.detector_noise import pitch_and_roll

Array = np.ndarray

LIMBS = np.array([landmarks.INDEX[name] for name in (
    "left_shoulder", "right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist",
    "left_hip", "right_hip", "left_knee", "right_knee", "left_ankle", "right_ankle",
)])  # fmt: skip
SAME_PERSON = 0.10
"""Median distance, share of the height, within which a detection is this person's (sides exchanged or not)."""
USUAL_FRACTION, USUAL_M = 0.02, 0.08
"""Usual errors in the picture and in 3D, to weigh one against the other."""
LIMBS_PER_STATURE = 0.754
"""Ankle to shoulder along the bones, over the height of body24's template."""


@dataclass(frozen=True, eq=False)
class PersonErrors:
    """One person of the truth in one shot, n frames in which most of the person can be seen."""

    clip: str
    person: int
    """Index into the truth's people."""
    rows: Int[Array, " n"]
    """Rows of that person."""
    keypoints: Float[Array, "n 33 3"]
    """Source pixels and visibility, sides put right; NaN where not found."""
    landmarks: Float[Array, "n 33 3"]
    """3D landmarks as the detector gives them, sides put right."""
    found: Bool[Array, " n"]
    swapped: Bool[Array, " n"]
    """Left and right exchanged: the other way round the answer is nearer to the truth, in the picture and in depth."""
    error: Float[Array, "n 12 2"]
    """Detected minus true place, sides put right, shares of the height; NaN where not found."""
    landmark_m: Float[Array, "n 12"]
    """Distance of 3D landmarks from the truth about the mid-hip, in the axes of its ray; sides and size put right."""
    landmark_turned_m: Float[Array, "n 12"]
    """The same after the best rotation."""
    turn: Float[Array, "n 3"]
    """Rotation vector from the true posture to the detected, about x, y, z of the viewing ray's axes, radians."""
    pitch: Float[Array, " n"]
    """Of the viewing ray above the horizon, radians."""
    roll: Float[Array, " n"]
    """Of the camera about its axis, clockwise, radians."""


def person_errors(sequence: MotionSequence, scenes: Sequence[ScenePeople], clip: str) -> list[PersonErrors]:
    """Errors of everybody in every shot of the truth; clips without cameras have none."""
    if sequence.cameras is None:
        return []
    starts = [0, *(round((a + b) / 2) for a, b in sequence.transitions), sequence.num_frames]
    changing = np.zeros(sequence.num_frames, bool)
    for start, end in sequence.transitions:
        changing[start:end] = True
    tracks = [track for scene in scenes for track in scene.tracks]
    found = []
    for number, person in enumerate(sequence.people):
        for start, end in pairwise(starts):
            rows = (person.frame >= start) & (person.frame < end) & person.observed & ~changing[person.frame]
            if rows.sum() >= 3:
                found.append(_errors_in_shot(sequence, person, np.flatnonzero(rows), tracks, (clip, number)))
    return found


def _errors_in_shot(
    sequence: MotionSequence,
    person: PersonSequence,
    rows: Int[Array, " n"],
    tracks: Sequence[PersonTrack],
    name: tuple[str, int],
) -> PersonErrors:
    frame = person.frame[rows]
    cameras = sequence.cameras
    assert cameras is not None
    joints = pick(person.joints, sequence.joint_names, LIMB_NAMES)[rows]
    in_camera, pixels = _seen(joints, cameras, frame)
    height = _stature(joints) * cameras.K[frame, 1, 1] / in_camera[:, 6:8, 2].mean(axis=1)
    ray = in_camera[:, 6:8].mean(axis=1)
    R_cam_ray = ray_axes(ray)
    true = np.einsum("nba,nkb->nka", R_cam_ray, in_camera - ray[:, None])
    n = len(rows)
    error = np.full((n, 12, 2), np.nan)
    swapped, best = np.zeros(n, bool), np.full(n, SAME_PERSON)
    keypoints, landmarks3d = np.full((n, 33, 3), np.nan), np.full((n, 33, 3), np.nan)
    for track in tracks:
        _, i, j = np.intersect1d(frame, track.frame, return_indices=True)
        answers = [_answer(track, j, pixels[i], height[i], true[i], exchanged) for exchanged in (False, True)]
        exchanged = answers[1].cost < answers[0].cost
        for which, answer in zip((~exchanged, exchanged), answers, strict=True):
            better = which & (answer.distance < best[i])
            at = i[better]
            best[at], swapped[at], error[at] = answer.distance[better], answer is answers[1], answer.shift[better]
            keypoints[at], landmarks3d[at] = answer.keypoints[better], answer.landmarks[better]
    seen = np.isfinite(error[:, 0, 0])
    solid = landmarks3d[:, LIMBS]
    solid = solid - solid[:, 6:8].mean(axis=1, keepdims=True)
    R = np.tile(np.eye(3), (n, 1, 1))
    if seen.any():  # the network draws everybody as large as its average person
        solid = solid * np.median(np.linalg.norm(true[seen], axis=(1, 2)) / np.linalg.norm(solid[seen], axis=(1, 2)))
        R[seen] = kabsch(true[seen], solid[seen], np.ones((int(seen.sum()), 12)))
    pitch, roll = pitch_and_roll(cameras.R_world_cam[frame], ray)
    return PersonErrors(
        clip=name[0],
        person=name[1],
        rows=rows,
        keypoints=keypoints,
        landmarks=landmarks3d,
        found=seen,
        swapped=swapped,
        error=error,
        landmark_m=np.linalg.norm(solid - true, axis=-1),
        landmark_turned_m=np.linalg.norm(solid - np.einsum("nab,nkb->nka", R, true), axis=-1),
        turn=rotmat_to_rotvec(R),
        pitch=pitch,
        roll=roll,
    )


@dataclass(frozen=True, eq=False)
class _Answer:
    """A track's answer in m frames, sides as it names them or exchanged."""

    keypoints: Float[Array, "m 33 3"]
    landmarks: Float[Array, "m 33 3"]
    shift: Float[Array, "m 12 2"]
    distance: Float[Array, " m"]
    """Median over the limbs, share of the height."""
    cost: Float[Array, " m"]


def _answer(
    track: PersonTrack,
    rows: Int[Array, " m"],
    pixels: Float[Array, "m 12 2"],
    height: Float[Array, " m"],
    true: Float[Array, "m 12 3"],
    exchanged: bool,
) -> _Answer:
    order = landmarks.SWAP if exchanged else np.arange(landmarks.NUM_LANDMARKS)
    keypoints, solid = track.keypoints2d[rows][:, order], track.landmarks3d[rows][:, order]
    shift = (keypoints[:, LIMBS, :2] - pixels) / height[:, None, None]
    distance = np.median(np.linalg.norm(shift, axis=-1), axis=1)
    limbs = solid[:, LIMBS] - solid[:, [23, 24]].mean(axis=1, keepdims=True)
    depth = np.median(np.linalg.norm(limbs - true, axis=-1), axis=1)
    return _Answer(keypoints, solid, shift, distance, distance / USUAL_FRACTION + depth / USUAL_M)


def _seen(
    joints: Float[Array, "n k 3"], cameras: CameraSequence, frame: Int[Array, " n"]
) -> tuple[Float[Array, "n k 3"], Float[Array, "n k 2"]]:
    in_camera = world_to_camera(joints, cameras.R_world_cam[frame], cameras.t_world_cam[frame])
    return in_camera, project(in_camera, cameras.K[frame], near_m=1e-3)


def _stature(joints: Float[Array, "n 12 3"]) -> float:
    """Height of the person, from the length of legs and trunk."""
    chain = [(10, 8), (8, 6), (6, 0), (11, 9), (9, 7), (7, 1)]
    lengths = [np.linalg.norm(joints[:, a] - joints[:, b], axis=-1) for a, b in chain]
    return float(np.nanmedian(np.sum(lengths, axis=0)) / 2 / LIMBS_PER_STATURE)


@dataclass(frozen=True, eq=False)
class MeasuredClip:
    """One clip with what the detector made of it."""

    sequence: MotionSequence
    errors: list[PersonErrors]
