"""Everybody's tracks as a lifter sees them in space. Needs no torch: the shipped lifter is imported when it is used."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from humanmm.models.geometry.intrinsics import K_from_focal, default_focal_px
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.perception.interfaces import Lifted, Lifter, PersonFrames
from humanmm.models.records.tracks import MASK_SIDE, PersonTrack, PoseEstimates, ScenePeople

Array = np.ndarray


def keep(frames: PersonFrames, K: Float[Array, "3 3"]) -> Lifted:
    """The pose network's own landmarks, as they are (a `Lifter`)."""
    return Lifted(frames.landmarks3d)


def lifted_people(
    people: ScenePeople, lifter: Lifter, time_s: Float[Array, " F"], size: tuple[int, int]
) -> ScenePeople:
    """Everybody's tracks with the lifter's landmarks and poses; `size` is the picture's width and height."""
    K = K_from_focal(default_focal_px(*size), *size)
    return replace(people, tracks=tuple(_lifted(track, lifter, time_s, K) for track in people.tracks))


def person_frames(track: PersonTrack, time_s: Float[Array, " F"]) -> PersonFrames:
    """A track as lifters take it."""
    affine = track.mask_affine.astype(np.float64)
    return PersonFrames(
        time_s=time_s[track.frame],
        keypoints=track.keypoints2d.astype(np.float64),
        landmarks3d=track.landmarks3d.astype(np.float64),
        centre=affine @ np.array([MASK_SIDE / 2, MASK_SIDE / 2, 1.0]),
        side=np.linalg.norm(affine[:, :, 0], axis=1) * MASK_SIDE,
        keypoint_sigma=track.keypoint_sigma,
    )


def with_root_rotated(pose: PoseEstimates, R: Float[Array, "n 3 3"]) -> PoseEstimates:
    """The same poses, their roots in other axes: R from those that they are in."""
    vectors = pose.vectors.copy()
    vectors[:, 0] = rotmat_to_rotvec(R @ rotvec_to_rotmat(pose.vectors[:, 0].astype(np.float64)))
    return replace(pose, vectors=vectors)


def _lifted(track: PersonTrack, lifter: Lifter, time_s: Float[Array, " F"], K: Float[Array, "3 3"]) -> PersonTrack:
    found = lifter(person_frames(track, time_s), K)
    return replace(track, landmarks3d=found.landmarks3d, pose=found.pose)
