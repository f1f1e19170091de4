"""Errors of landmarks in space, as pose networks and lifters have them, against the bodies of a truth.

Landmarks have no place in the world: they are compared about the mid-hip, in the axes of the viewing ray through the
crop's centre, where errors across the ray (what a picture shows) and along it (what nobody sees) are told apart.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.body.landmarks import load_landmarks
from humanmm.models.evaluation.pose import METRES_TO_MM
from humanmm.models.geometry.alignment import umeyama_alignment
from humanmm.models.geometry.projection import project, world_to_camera
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.perception.interfaces import PersonFrames
from humanmm.models.perception.lifting.features import view_axes
from humanmm.models.records.landmarks import HIPS, LIMBS
from humanmm.models.records.sequence import MotionSequence
from humanmm.models.records.tracks import PersonTrack

Array = np.ndarray

NEAR_M = 0.1
FARTHEST = 0.15
"""Distance of a track's hips from those of a person, in the median over their frames and as a fraction of the crop's
side, from which the track is not his."""
FEWEST_FRAMES = 5


@dataclass(frozen=True, eq=False)
class TrueBody:
    """One person of a truth as the cameras see him; N frames."""

    frame: Int[Array, " N"]
    landmarks: Float[Array, "N 33 3"]
    """Camera axes, metres."""
    hips: Float[Array, "N 2"]
    """Source pixels."""
    K: Float[Array, "N 3 3"]


@dataclass(frozen=True, eq=False)
class ShownBody:
    """Whom a track shows; n of its frames."""

    rows: Int[Array, " n"]
    """Of the track."""
    landmarks: Float[Array, "n 33 3"]
    """Metres about the mid-hip, axes of the viewing ray through the track's crop."""


@dataclass(frozen=True, eq=False)
class LandmarkErrors:
    """Of the twelve limb landmarks in n frames, mm."""

    pa_mpjpe_mm: Float[Array, " n"]
    """After the best similarity of each frame."""
    mpjpe_mm: Float[Array, " n"]
    """About the mid-hip."""
    across_mm: Float[Array, " n"]
    """Of what that similarity leaves: across the viewing ray."""
    along_mm: Float[Array, " n"]
    """Along it."""


def true_bodies(truth: MotionSequence) -> list[TrueBody]:
    """Everybody of a truth that has body parameters and cameras."""
    if truth.cameras is None:
        return []
    body, model, found = load_body(), load_landmarks(), []
    for person in truth.people:
        if person.body is None:
            continue
        rest, own = body.rest_joints(person.body.betas), person.body
        joints, R = forward_kinematics(rest, rotvec_to_rotmat(own.root_orient), own.body_pose, own.transl + rest[0])
        landmarks = world_to_camera(
            model.place(own.betas, joints, R),
            truth.cameras.R_world_cam[person.frame],
            truth.cameras.t_world_cam[person.frame],
        )
        K = truth.cameras.K[person.frame]
        hips = project(landmarks[:, list(HIPS)].mean(axis=1, keepdims=True), K, near_m=NEAR_M)[:, 0]
        found.append(TrueBody(person.frame, landmarks, hips, K))
    return found


def shown_by(track: PersonTrack, seen: PersonFrames, bodies: Sequence[TrueBody]) -> ShownBody | None:
    """The body whose hips a track follows (`seen`: the track as lifters take it); None where it follows nobody's."""
    hips = seen.keypoints[:, list(HIPS), :2].mean(axis=1)
    best, nearest = None, FARTHEST
    for body in bodies:
        _, rows, own = np.intersect1d(track.frame, body.frame, return_indices=True)
        if len(rows) < FEWEST_FRAMES:
            continue
        away = float(np.median(np.linalg.norm(hips[rows] - body.hips[own], axis=1) / seen.side[rows]))
        if away < nearest:
            about = body.landmarks[own] - body.landmarks[own][:, list(HIPS)].mean(axis=1, keepdims=True)
            best, nearest = ShownBody(rows, about @ view_axes(seen.centre[rows], body.K[own])), away
    return best


def landmark_errors(found: Float[Array, "n 33 3"], true: Float[Array, "n 33 3"]) -> LandmarkErrors:
    """Of landmarks in the same axes."""
    about = found - found[:, list(HIPS)].mean(axis=1, keepdims=True)
    about, wanted = (METRES_TO_MM * points[:, list(LIMBS)].astype(np.float64) for points in (about, true))
    left = umeyama_alignment(about, wanted, unique=False).apply(about) - wanted
    return LandmarkErrors(
        pa_mpjpe_mm=np.linalg.norm(left, axis=-1).mean(axis=1),
        mpjpe_mm=np.linalg.norm(about - wanted, axis=-1).mean(axis=1),
        across_mm=np.linalg.norm(left[..., :2], axis=-1).mean(axis=1),
        along_mm=np.abs(left[..., 2]).mean(axis=1),
    )
