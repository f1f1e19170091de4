"""Proportions of a body from the bones that a pose network sees.

Its bone lengths differ less between people than the people do, and err by a tenth for all frames of somebody alike, so
that they say little about who somebody is.
"""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from jaxtyping import Float

from humanmm.models.body.body24 import JOINT_NAMES, Body, load_body
from humanmm.models.body.landmarks import load_landmarks
from humanmm.models.records import landmarks

BONE_NOISE = 0.1
"""Standard deviation of a bone's logarithmic length in 3D landmarks, mostly the same in all frames. Rendered people
have 0.06 (shanks, trunk) to 0.15 (arms), which makes real ones too tall (docs/measurements/world.md)."""
SCALE_NOISE = 0.3
"""Standard deviation of the common factor (its logarithm) of all bones of somebody whose height the user gave."""
RESIZED_RIDGE_M2 = 1e-3
"""What a unit of shape costs against squared errors of joints, m²: bodies a tenth larger are then right to 15 mm."""
BONE_BIAS = np.array([-0.08, -0.08, -0.07, -0.16, -0.09, -0.03, 0.01])
"""Logarithm of the detector's bone lengths over body24's, for `bone_lengths` of one and the same person: its landmarks
lie elsewhere than the joints (measured on renderings of 300 random bodies; real clips agree)."""


def in_detector_convention(bones: Float[np.ndarray, "frames 7"], *, lifted: bool) -> Float[np.ndarray, "frames 7"]:
    """Lifted landmarks lie where `body.landmarks` has them: their bones differ from body24's by that alone."""
    return np.asarray(bones * np.exp(BONE_BIAS - _lifted_bias())) if lifted else bones


@lru_cache(maxsize=1)
def _lifted_bias() -> Float[np.ndarray, " 7"]:
    """Logarithm of the average body's bones between landmarks over those between joints."""
    body, model, shape = load_body(), load_landmarks(), np.zeros(load_body().num_betas)
    points = body.rest_joints(shape)[model.joint] + model.offsets(shape)
    return np.asarray(np.log(bone_lengths(points[None])[0] / _body_bones(body, shape)))


_PAIRS = (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"))
_JOINT_OF = {"shoulder": "Shoulder", "elbow": "Elbow", "wrist": "Wrist", "hip": "Hip", "knee": "Knee", "ankle": "Ankle"}


def bone_lengths(poses: Float[np.ndarray, "frames 33 3"]) -> Float[np.ndarray, "frames 7"]:
    """Upper arm, forearm, thigh, shank (mean of both sides), shoulders, hips, trunk of landmarks, metres."""

    def point(side: str, name: str) -> np.ndarray:
        return poses[:, landmarks.INDEX[f"{side}_{name}"]]

    return _lengths(point)


def shape_from_bones(
    bones: Float[np.ndarray, "frames 7"], body: Body, *, height_m: float | None = None
) -> Float[np.ndarray, " betas"]:
    """Shape whose bone lengths are likeliest: ridge regression of log lengths, prior N(0, 1) on every component.

    With a known height the shape stands exactly so tall; the bones then give proportions, their common factor is free
    within SCALE_NOISE.
    """
    wanted = np.log(np.median(bones, axis=0) / _body_bones(body, np.zeros(body.num_betas))) - BONE_BIAS
    step = 0.5
    jacobian = np.column_stack(
        [
            np.log(_body_bones(body, step * unit) / _body_bones(body, -step * unit)) / (2 * step)
            for unit in np.eye(body.num_betas)
        ]
    )
    trust: np.ndarray = np.eye(len(wanted)) / BONE_NOISE**2
    if height_m is not None:
        trust = np.linalg.inv(BONE_NOISE**2 * np.eye(len(wanted)) + SCALE_NOISE**2)
    normal = jacobian.T @ trust @ jacobian + np.eye(body.num_betas)
    betas = np.linalg.solve(normal, jacobian.T @ trust @ wanted)
    return np.asarray(betas if height_m is None else _as_tall(betas, normal, body, height_m), np.float32)


def resized(betas: Float[np.ndarray, " betas"], body: Body, factor: float) -> Float[np.ndarray, " betas"]:
    """The shape whose joints lie `factor` times as far apart: least squares, the change of shape small besides."""
    by_joint = body.J_shapedirs.reshape(body.num_betas, -1)
    missing = ((factor - 1) * body.rest_joints(betas)).ravel()
    normal = by_joint @ by_joint.T + RESIZED_RIDGE_M2 * np.eye(body.num_betas)
    return np.asarray(betas + np.linalg.solve(normal, by_joint @ missing))


def _as_tall(
    betas: Float[np.ndarray, " betas"], normal: np.ndarray, body: Body, height_m: float
) -> Float[np.ndarray, " betas"]:
    """The likeliest shape of one height: Newton's steps on the constraint, each the shortest by the metric `normal`."""
    found: np.ndarray = betas
    for _ in range(20):
        missing = height_m - body.standing_height(found)
        if abs(missing) < 1e-4:
            break
        ends = [[body.standing_height(found + side * unit) for side in (-0.05, 0.05)] for unit in np.eye(len(found))]
        slope = np.diff(ends, axis=1)[:, 0] / 0.1
        direction = np.linalg.solve(normal, slope)
        found = found + direction * missing / (slope @ direction)
    return found


def _body_bones(body: Body, betas: Float[np.ndarray, " betas"]) -> Float[np.ndarray, " 7"]:
    joints = body.rest_joints(betas)

    def point(side: str, name: str) -> np.ndarray:
        return np.asarray(joints[None, JOINT_NAMES.index(f"{side[0].upper()}_{_JOINT_OF[name]}")])

    return np.asarray(_lengths(point)[0])


def _lengths(point: Callable[[str, str], np.ndarray]) -> Float[np.ndarray, "frames 7"]:
    def length(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.asarray(np.linalg.norm(a - b, axis=-1))

    sides = ("left", "right")
    limbs = [np.mean([length(point(side, a), point(side, b)) for side in sides], axis=0) for a, b in _PAIRS]
    shoulders, hips = [[point(side, name) for side in sides] for name in ("shoulder", "hip")]
    trunk = length((shoulders[0] + shoulders[1]) / 2, (hips[0] + hips[1]) / 2)
    return np.stack([*limbs, length(*shoulders), length(*hips), trunk], axis=-1)
