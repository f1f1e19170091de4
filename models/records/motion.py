"""Human motion as it travels between stages: per shot in camera axes, then in one world.

World: z up, metres, floor at z = 0. Camera: x right, y down, z forward. Names R_a_b map b to a.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np


@dataclass(frozen=True)
class PersonShotMotion:
    """One person in one shot, in the camera axes of each frame. N frames without holes between first and last."""

    person: int
    frame: np.ndarray
    """(N,) int32."""
    observed: np.ndarray
    """(N,) bool; false where filled in."""
    R_cam_root: np.ndarray
    """(N,3,3) float64, pelvis (body) axes to camera axes: Γ."""
    body_pose: np.ndarray
    """(N,23,3) float32, axis-angle, SMPL order: θ."""
    betas: np.ndarray
    """(10,) float64: β."""
    pelvis_cam: np.ndarray
    """(N,3) float64, pelvis joint in camera axes, metres: τ."""
    residual_px: np.ndarray
    """(N,) float32, robust mean reprojection error of the visible keypoints."""
    confidence: np.ndarray
    """(N,) float32, 0..1: how much of what was visible the fit explains, times 1 - misoriented."""
    misoriented: np.ndarray
    """(N,) float32: probability that R_cam_root is off by more than 45°."""
    pose_error_m: np.ndarray
    """(N,) float32, metres: expected PA-MPJPE of the joints; NaN where nothing foretells it."""


@dataclass(frozen=True)
class ShotMotion:
    """All people of one shot."""

    start: int
    end: int
    people: tuple[PersonShotMotion, ...]


@dataclass(frozen=True)
class CutHypothesis:
    """One rotation of the camera at a cut that may be the true one."""

    R_before_after: np.ndarray
    """(3,3) float64, as in `CutAlignment`."""
    sigma_deg: float
    """Expected error if this is the true one."""
    probability: float
    """That it is; those of a cut may add up to less than 1, the rest is for none of them."""
    source: str
    """Whose evidence it is, for the record."""


@dataclass(frozen=True)
class RotationEvidence:
    """What became of one piece of evidence about the rotation between two shots."""

    shot_a: int
    shot_b: int
    source: str
    num_points: int
    """Background points that support it; 0 for evidence from people."""
    used: bool
    reason: str
    """Why it was not used; empty if it was."""


@dataclass(frozen=True)
class PoseJump:
    """How far the limbs of somebody are, right after a cut, from where they were going before it."""

    person: int
    jump_m: float
    """Root mean square over knees, ankles, head, elbows and wrists, about the pelvis and in its axes."""
    expected_m: float
    """How far the poses of both sides together are expected to be off."""


@dataclass(frozen=True)
class CutAlignment:
    """How two neighbouring shots were joined."""

    cut_frame: int
    method: str
    """`bundle`, `eight-point` or the name of another method; `given`: the rotation is known from elsewhere; `none`: the
    shots share no person, see `linked`."""
    R_before_after: np.ndarray
    """(3,3) float64: camera axes of the first frame after the cut to those of the last frame before it."""
    residual_px: float
    """Robust reprojection residual of the winning hypothesis, pixels."""
    uncertainty_deg: float
    """The rotation lies within this angle of the true one with a probability of 68 %."""
    gap_s: float
    """Time between the last and the first observation used."""
    linked: bool
    """People or a common background connect the two shots."""
    warnings: tuple[str, ...] = ()
    background_inliers: int = 0
    """Points of the background that also determine how the two cameras are rotated; 0 if none do."""
    hypotheses: tuple[CutHypothesis, ...] = ()
    """All rotations that the people allow, likeliest first; empty if the method knows one only."""
    probability: float = 1.0
    """That the rotation is the right one of all that the evidence allows."""
    within_95_deg: float = 180.0
    """The rotation lies within this angle of the true one with a probability of 95 %."""
    pose_jumps: tuple[PoseJump, ...] = ()
    """Of those who are seen right before and right after the cut."""


@dataclass(frozen=True)
class PathScale:
    """How well the scale of a moving camera's path is known."""

    shot: int
    source: Literal["floor", "feet", "assumed"]
    """What gave it: the floor that the camera sees (feet as well), feet alone, or nothing: its unit is a metre."""
    relative_uncertainty: float
    """Standard deviation of its logarithm, against the size of the people; nan where it is assumed."""


@dataclass(frozen=True)
class Facing:
    """Whether one person's body is turned the right way in one shot."""

    person: int
    shot: int
    probability: float
    """Mean over the time in which he is seen: that his orientation is off by no more than 45°."""
    doubtful: tuple[tuple[int, int], ...]
    """Frames [start, end) in which that is hardly known."""
    worst_s: float = 0.0
    """Seconds that he is expected to be turned the wrong way in the worst of these."""


@dataclass(frozen=True)
class PoseError:
    """How far one person's pose is expected to be off in one shot."""

    person: int
    shot: int
    error_m: float
    """Expected PA-MPJPE of the joints, mean over the time in which he is seen, metres; NaN where nothing foretells
    it."""
    doubtful: tuple[tuple[int, int], ...]
    """Frames [start, end) in which it is far larger than usual."""


@dataclass(frozen=True)
class PersonMotion:
    """One person over the whole video, in the world. N frames without holes between first and last."""

    person: int
    frame: np.ndarray
    """(N,) int32."""
    observed: np.ndarray
    """(N,) bool."""
    R_world_root: np.ndarray
    """(N,3,3) float64."""
    body_pose: np.ndarray
    """(N,23,3) float32, axis-angle."""
    betas: np.ndarray
    """(10,) float64."""
    pelvis_world: np.ndarray
    """(N,3) float64, pelvis joint, metres."""
    contacts: np.ndarray
    """(N,4) float32, probability: left ankle, left toe base, right ankle, right toe base."""
    confidence: np.ndarray
    """(N,) float32."""


@dataclass(frozen=True)
class WorldMotion:
    """The whole video in one world: cameras and people."""

    R_world_cam: np.ndarray
    """(F,3,3) float64."""
    t_world_cam: np.ndarray
    """(F,3) float64, metres."""
    K: np.ndarray
    """(F,3,3) float64."""
    camera_source: np.ndarray
    """(F,) uint8, index into records.camera.SOURCES."""
    people: tuple[PersonMotion, ...]
    cuts: tuple[CutAlignment, ...]
    warnings: tuple[str, ...] = ()
    evidence: tuple[RotationEvidence, ...] = ()
    """Everything that spoke for a rotation between two shots, and whether it was believed."""
    path_scales: tuple[PathScale, ...] = ()
    """Of every shot whose camera travels and whose scale was not given."""
    focal_factor: float = 1.0
    """How many times as long as `intrinsics` has it the focal length in `K` is: the solve for positions knows more."""
    focal_dispute: float = 0.0
    """By how much the solve would change the logarithm of the focal length, where that is too much to believe."""
    facings: tuple[Facing, ...] = ()
    """Of everybody in every shot."""
    pose_errors: tuple[PoseError, ...] = ()
    """Of everybody in every shot."""
