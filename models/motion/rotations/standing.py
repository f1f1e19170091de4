"""People in level axes, and how high a shot's camera stands above the floor that they stand on."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from humanmm.models.motion.rotations.shot_results import ShotResults, camera_of, posed
from humanmm.models.records.camera import ShotCamera
from humanmm.models.records.landmarks import ANKLES, BEYOND
from humanmm.models.records.motion import PersonShotMotion
from humanmm.models.video.frame_times import ROUNDING_S

Array = np.ndarray

FEET = (*ANKLES, *(end for ankle in ANKLES for end in BEYOND[ankle]))
LEAST_VISIBILITY = 0.5
FLOOR_S, FLOOR_QUANTILE = 0.5, 0.2
"""The floor is as high as the lower soles in this quantile of the frames so near in time."""


@dataclass(frozen=True, eq=False)
class Standing:
    """One person in the n frames of his motion in a shot; level axes, z up."""

    joints: Float[Array, "n 24 3"]
    """About the pelvis, metres."""
    pelvis: Float[Array, "n 3"]
    """About the camera, metres."""
    floor: Float[Array, " n"]
    """Height of the floor about the camera, metres."""
    R_level_cam: Float[Array, "n 3 3"]
    feet_seen: Bool[Array, " n"]
    """Where no foot is seen, the floor is a guess."""


def standing(results: ShotResults, shot: int, motion: PersonShotMotion, axes: Float[Array, "3 3"]) -> Standing:
    """A person of a shot; `axes`: level axes of the shot, z up, as columns."""
    camera = camera_of(results, shot)
    R_level_cam = axes.T @ camera.R_shot_cam[motion.frame - camera.start]
    joints, soles = posed(motion, R_level_cam)
    pelvis = np.einsum("nab,nb->na", R_level_cam, motion.pelvis_cam)
    floor = _floor_height(soles[..., 2].min(axis=1) + pelvis[:, 2], results.time_s[motion.frame], camera)
    feet_seen = motion.observed & np.isin(motion.frame, _feet_in_view(results, shot, motion.person))
    return Standing(joints, pelvis, floor, R_level_cam, feet_seen)


def _feet_in_view(results: ShotResults, shot: int, person: int) -> Int[Array, " n"]:
    """Frames in which a foot is seen."""
    scene = results.scenes[results.shots.shots[shot].scene]
    tracks = [scene.track_of(one) for one in results.shots.shots[shot].people if one.person == person and scene]
    seen = [track.frame[(track.keypoints2d[:, FEET, 2] >= LEAST_VISIBILITY).any(axis=1)] for track in tracks]
    return np.concatenate([np.zeros(0, np.int32), *seen])


def _floor_height(lowest: Float[Array, " n"], time_s: Float[Array, " n"], camera: ShotCamera) -> Float[Array, " n"]:
    """From the heights of the lower soles about the camera, in order of time; a camera that stays has one floor."""
    if not camera.travels:
        return np.full(len(lowest), np.quantile(lowest, FLOOR_QUANTILE))
    first, end = (np.searchsorted(time_s, time_s + side * (FLOOR_S + ROUNDING_S)) for side in (-1, 1))
    about = [slice(*bounds) for bounds in zip(first, end, strict=True)]
    near = (lowest[at][np.abs(time_s[at] - now) <= FLOOR_S] for at, now in zip(about, time_s, strict=True))
    return np.array([np.quantile(some, FLOOR_QUANTILE) for some in near])
