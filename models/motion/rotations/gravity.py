"""Which way is up: from people who stand and cameras that are held level, robust to those who bend and to tilted
cameras.

Everything comes in one set of axes in which only gravity is unknown (all shots already rotated into each other). A
body's long axis counts by how upright its posture is (straight legs and trunk in one line), whatever its lean: a
person who bends or lies does not count. A camera's x axis is usually level; a rotating camera usually rotates about the
vertical.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from humanmm.models.geometry.robust import cauchy_loss, cauchy_weight
from humanmm.models.geometry.rotations import unit

Array = np.ndarray

HIPS, KNEES, ANKLES, NECK = (1, 2), (4, 5), (7, 8), 12
"""Joints of body24 (SMPL's order)."""

BODY_SIGMA_DEG = 8.0
"""Error of one person's mean long axis in one shot: lean of the gait and error of the pose estimator."""
ROLL_SIGMA_DEG = 5.0
PAN_SIGMA_DEG = 6.0
MIN_PAN_DEG = 8.0
"""The axis of a camera that rotated less than this does not count."""


@dataclass(frozen=True)
class UprightEvidence:
    """Directions that should be vertical (sign known), and lines that should be level."""

    up: Float[Array, "n 3"]
    up_sigma_deg: Float[Array, "n"]
    level: Float[Array, "m 3"]
    level_sigma_deg: Float[Array, "m"]


def standing_axis(joints: Float[Array, "frames 24 3"]) -> tuple[Float[Array, "frames 3"], Float[Array, "frames"]]:
    """Each frame's axis from the feet to the neck, and how much it says about gravity (0..1)."""
    hips, ankles = joints[:, HIPS].mean(axis=1), joints[:, ANKLES].mean(axis=1)
    knees, neck = joints[:, KNEES].mean(axis=1), joints[:, NECK]
    axis = unit(neck - ankles)
    trunk, leg = unit(neck - hips), unit(hips - ankles)
    aligned = np.sum(trunk * leg, axis=1)
    straight = np.linalg.norm(hips - ankles, axis=1) / np.maximum(
        np.linalg.norm(hips - knees, axis=1) + np.linalg.norm(knees - ankles, axis=1), 1e-6
    )
    weight = np.clip((aligned - 0.7) / 0.25, 0, 1) * np.clip((straight - 0.7) / 0.25, 0, 1)
    return axis, weight


def mean_axis(axis: Float[Array, "frames 3"], weight: Float[Array, "frames"]) -> tuple[Float[Array, "3"], float]:
    """Robust mean of one person's standing axes in one shot, and its sigma in degrees (large if hardly standing)."""
    centre = unit((axis * (weight[:, None] + 1e-3)).sum(axis=0))
    for _ in range(10):
        off = np.linalg.norm(axis - centre, axis=1)
        robust = weight * cauchy_weight((off / np.deg2rad(12.0)) ** 2)
        centre = unit((axis * (robust[:, None] + 1e-4)).sum(axis=0))
    seconds = float(weight.mean())
    return centre, BODY_SIGMA_DEG / np.sqrt(max(seconds, 0.02))


def pan_axis(R_shot_cam: Float[Array, "frames 3 3"]) -> Float[Array, "3"] | None:
    """Axis about which a camera rotated over a shot, up or down unknown; None if it hardly rotated."""
    relative = R_shot_cam @ R_shot_cam[0].T
    skewed = np.stack(
        [
            relative[:, 2, 1] - relative[:, 1, 2],
            relative[:, 0, 2] - relative[:, 2, 0],
            relative[:, 1, 0] - relative[:, 0, 1],
        ],
        axis=1,
    )
    size = np.linalg.norm(skewed, axis=1)
    widest = int(size.argmax())
    if size[widest] < 2 * np.sin(np.deg2rad(MIN_PAN_DEG)):
        return None
    return np.asarray(skewed[widest] / size[widest])


def up_direction(evidence: UprightEvidence) -> Float[Array, "3"]:
    """Unit vector opposite to gravity: robust Gauss-Newton over directions, from each that should be up."""
    if not len(evidence.up):
        raise ValueError("no direction is known to point up")
    up = unit(evidence.up)
    sigma_up, sigma_level = np.deg2rad(evidence.up_sigma_deg), np.deg2rad(evidence.level_sigma_deg)
    for _ in range(20):
        tangent = np.swapaxes(np.linalg.svd(up[:, None])[2][:, 1:], -1, -2)
        r_up = (evidence.up - up[:, None]) @ tangent / sigma_up[:, None]
        r_level = up @ evidence.level.T / sigma_level
        # Behind the equator the tangent plane lies: count the true angle.
        length = np.arccos(np.clip(up @ evidence.up.T, -1, 1)) / sigma_up
        w_up, w_level = cauchy_weight(length**2 / 4), cauchy_weight(r_level**2 / 4)
        cost = cauchy_loss(length**2 / 4).sum(axis=1) + cauchy_loss(r_level**2 / 4).sum(axis=1)
        J = evidence.level @ tangent / sigma_level[:, None]
        weighted = np.swapaxes(J * w_level[..., None], -1, -2)
        A = weighted @ J + ((w_up / sigma_up**2).sum(axis=1) + 1e-9)[:, None, None] * np.eye(2)
        b = ((w_up / sigma_up)[:, None] @ r_up)[:, 0] - (weighted @ r_level[..., None])[..., 0]
        step = (tangent @ np.linalg.solve(A, b[..., None]))[..., 0]
        up = unit(up + step)
        if np.linalg.norm(step, axis=1).max() < 1e-6:
            break
    return np.asarray(up[cost.argmin()])
