"""Per-vertex error (PVE): the skin of two bodies of the same model, about the root and in camera axes."""

import numpy as np
from jaxtyping import Float

from humanmm.models.body.body24 import JOINT_NAMES, NUM_JOINTS, Body, load_body
from humanmm.models.body.kinematics import forward_kinematics, skinning_transforms
from humanmm.models.evaluation.pose import METRES_TO_MM
from humanmm.models.evaluation.skeleton import mid_hip
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.records.sequence import BodyParameters, UndefinedFigureError

CHUNK_FRAMES, CHUNK_VERTICES = 32, 1024
"""Of the skin (13,718 vertices) so much is worked on at a time: it stays in the processor's cache."""


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
    sides = ((predicted, predicted_rows, R_world_cam_predicted), (truth, truth_rows, R_world_cam_truth))
    blends = [_blend(load_body(), parameters) for parameters, _, _ in sides]
    num_vertices, total = len(blends[0]), 0.0
    for start in range(0, len(truth_rows), CHUNK_FRAMES):
        chunk = slice(start, start + CHUNK_FRAMES)
        transforms = [
            _transforms(parameters, rows[chunk], R_world_cam[chunk]) for parameters, rows, R_world_cam in sides
        ]
        for first in range(0, num_vertices, CHUNK_VERTICES):
            posed, true = (
                blend[first : first + CHUNK_VERTICES] @ transform  # linear blend skinning
                for blend, transform in zip(blends, transforms, strict=True)
            )
            squared = np.square(posed - true).reshape(len(posed), 3, -1).sum(axis=1)
            total += float(np.sqrt(squared).sum(dtype=np.float64)) / num_vertices
    return METRES_TO_MM * total / len(truth_rows)


def _blend(body: Body, parameters: BodyParameters) -> Float[np.ndarray, "vertices 96"]:
    """Each rest vertex (x, y, z, 1) times its weight for every joint."""
    vertices = body.rest_vertices(np.asarray(parameters.betas, np.float64))
    weights = np.zeros((len(vertices), NUM_JOINTS), np.float32)
    np.add.at(weights, (np.arange(len(vertices))[:, None], body.skin_joint), body.skin_weight)
    one = np.concatenate([vertices, np.ones((len(vertices), 1), np.float32)], axis=1)
    return np.asarray((weights[:, :, None] * one[:, None]).reshape(len(vertices), -1))


def _transforms(
    parameters: BodyParameters, rows: np.ndarray, R_world_cam: Float[np.ndarray, "frames 3 3"]
) -> Float[np.ndarray, "96 coordinates"]:
    """Every joint's rest-to-posed transform about the hips in camera axes; coordinates are 3 × frames."""
    rest_joints = load_body().rest_joints(np.asarray(parameters.betas, np.float64))
    R_root = rotvec_to_rotmat(parameters.root_orient[rows])
    joints, R = forward_kinematics(rest_joints, R_root, parameters.body_pose[rows], np.zeros((len(rows), 3)))
    transforms = skinning_transforms(rest_joints, joints - mid_hip(joints, JOINT_NAMES)[:, None], R)
    in_camera = np.swapaxes(R_world_cam, -1, -2)[:, None] @ transforms
    return np.asarray(in_camera.transpose(1, 3, 2, 0).reshape(4 * NUM_JOINTS, -1).astype(np.float32))
