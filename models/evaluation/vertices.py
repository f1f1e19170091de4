"""Per-vertex error (PVE): the skin of two bodies of the same model, about the root and in camera axes."""

import numpy as np
from jaxtyping import Float

from humanmm.models.body.body24 import JOINT_NAMES, Body, load_body
from humanmm.models.body.kinematics import forward_kinematics, skin, skinning_transforms
from humanmm.models.evaluation.pose import METRES_TO_MM, in_camera_axes
from humanmm.models.evaluation.skeleton import mid_hip
from humanmm.models.evaluation.take import BodyParameters, UndefinedFigureError
from humanmm.models.rotations import rotation_from_vector

CHUNK_FRAMES = 32
"""Frames whose skin (13,718 vertices) is in memory at the same time."""


def pve_mm(
    predicted: BodyParameters | None,
    truth: BodyParameters | None,
    *,
    predicted_rows: np.ndarray,
    truth_rows: np.ndarray,
    R_world_cam_predicted: Float[np.ndarray, "frames 3 3"],
    R_world_cam_truth: Float[np.ndarray, "frames 3 3"],
) -> float:
    """Mean distance of corresponding vertices, mm, hips on hips, each body in the axes of its own camera.

    `*_rows` are the common frames' rows in each body's arrays. Raises UndefinedFigureError unless both are body24.
    """
    if predicted is None or truth is None:
        raise UndefinedFigureError(f"the {'prediction' if predicted is None else 'truth'} has no body parameters")
    if (predicted.model, truth.model) != ("body24", "body24"):
        raise UndefinedFigureError(f"the prediction's body is {predicted.model}, the truth's {truth.model}, not body24")
    body, total = load_body(), 0.0
    for start in range(0, len(truth_rows), CHUNK_FRAMES):
        chunk = slice(start, start + CHUNK_FRAMES)
        skins = [
            in_camera_axes(_skin_about_hips(body, parameters, rows[chunk]), R_world_cam[chunk])
            for parameters, rows, R_world_cam in (
                (predicted, predicted_rows, R_world_cam_predicted),
                (truth, truth_rows, R_world_cam_truth),
            )
        ]
        total += float(np.linalg.norm(skins[0] - skins[1], axis=-1).mean(axis=-1).sum())
    return METRES_TO_MM * total / len(truth_rows)


def _skin_about_hips(
    body: Body, parameters: BodyParameters, rows: np.ndarray
) -> Float[np.ndarray, "frames vertices 3"]:
    betas = np.asarray(parameters.betas, np.float64)
    rest_joints = body.rest_joints(betas)
    R_root = rotation_from_vector(parameters.root_orient[rows])
    joints, R = forward_kinematics(rest_joints, R_root, parameters.body_pose[rows], np.zeros((len(rows), 3)))
    vertices = skin(body, body.rest_vertices(betas), skinning_transforms(rest_joints, joints, R))
    return np.asarray(vertices - mid_hip(joints, JOINT_NAMES)[:, None])
