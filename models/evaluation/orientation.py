"""Root orientation error (ROE), whole and heading only, and root orientations from joints alone.

ROE has no public code: WHAM's authors replaced it before release. Here: one rotation brings the first common frame of
the video onto the truth, none after that, so a wrong rotation at a cut counts in every later frame.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from humanmm.models.evaluation.skeleton import pick
from humanmm.models.geometry.rotations import rotation_angle, unit

R_WORLD_UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Body axes (y up, facing +z, x to its left) to world of somebody upright whose left points along the world's x."""


def root_orientation_error_deg(
    predicted: Float[np.ndarray, "frames 3 3"], truth: Float[np.ndarray, "frames 3 3"]
) -> float:
    """Mean geodesic angle, degrees, after R_truth[0] R_pred[0]ᵀ is applied on the left to all of the prediction."""
    R_truth_pred = truth[0] @ predicted[0].T
    aligned = R_truth_pred @ predicted
    return float(np.degrees(rotation_angle(np.swapaxes(truth, -1, -2) @ aligned)).mean())


def heading(R_world_root: Float[np.ndarray, "frames 3 3"]) -> Float[np.ndarray, "frames"]:
    """(N,) yaw in radians of the upright body nearest to each orientation.

    The rotation about z nearest to Q = R R_uprightᵀ has the angle atan2(Q10 − Q01, Q00 + Q11); unlike the projection of
    the chest's direction it does not tumble when somebody bends over or lies down on a side.
    """
    Q = R_world_root @ R_WORLD_UPRIGHT.T
    return np.asarray(np.arctan2(Q[:, 1, 0] - Q[:, 0, 1], Q[:, 0, 0] + Q[:, 1, 1]))


def heading_error_deg(predicted: Float[np.ndarray, "frames 3 3"], truth: Float[np.ndarray, "frames 3 3"]) -> float:
    """Mean absolute difference of the headings, degrees, after the first common frame's are made equal."""
    difference = heading(predicted) - heading(truth)
    difference -= difference[0]
    wrapped = np.arctan2(np.sin(difference), np.cos(difference))
    return float(np.degrees(np.abs(wrapped)).mean())


def orientation_from_joints(
    joints: Float[np.ndarray, "frames joints 3"], joint_names: Sequence[str]
) -> Float[np.ndarray, "frames 3 3"]:
    """(N,3,3) body to world from hips and shoulders: x to the left hip, z = x × trunk, y = z × x."""
    left_hip, right_hip, left_shoulder, right_shoulder = np.moveaxis(
        pick(joints, joint_names, ("L_Hip", "R_Hip", "L_Shoulder", "R_Shoulder")), 1, 0
    )
    x = unit(left_hip - right_hip)
    trunk = 0.5 * (left_shoulder + right_shoulder) - 0.5 * (left_hip + right_hip)
    z = unit(np.cross(x, trunk))
    return np.stack([x, np.cross(z, x), z], axis=-1)
