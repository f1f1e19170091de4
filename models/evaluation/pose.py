"""Errors of the pose alone: where the joints are about the root (Human3.6M's protocols 1 and 2, and per vertex)."""

import numpy as np
from jaxtyping import Float

from humanmm.models.geometry.alignment import umeyama_alignment, yaw_alignment

METRES_TO_MM = 1000.0


def point_error_mm(
    predicted: Float[np.ndarray, "frames points 3"], truth: Float[np.ndarray, "frames points 3"]
) -> float:
    """Mean distance of corresponding points, mm."""
    return METRES_TO_MM * float(np.linalg.norm(predicted - truth, axis=-1).mean())


def pa_mpjpe_mm(predicted: Float[np.ndarray, "frames joints 3"], truth: Float[np.ndarray, "frames joints 3"]) -> float:
    """Mean joint distance after the best similarity of every single frame, mm."""
    return point_error_mm(umeyama_alignment(predicted, truth).apply(predicted), truth)


def in_camera_axes(
    relative: Float[np.ndarray, "frames joints 3"], R_world_cam: Float[np.ndarray, "frames 3 3"]
) -> Float[np.ndarray, "frames joints 3"]:
    """World vectors in the axes of each frame's camera: R_world_camᵀ v."""
    return np.asarray(relative @ R_world_cam)


def rotated_by_one_yaw(
    predicted: Float[np.ndarray, "frames joints 3"], truth: Float[np.ndarray, "frames joints 3"]
) -> Float[np.ndarray, "frames joints 3"]:
    """Root-relative predicted joints after the one yaw of the whole video that brings them closest to the truth."""
    return np.asarray(predicted @ yaw_alignment(predicted, truth).T)
