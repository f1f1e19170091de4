"""Errors of the motion through the world: WA- and W-MPJPE (100-frame chunks), RTE, and the jump at a cut."""

import numpy as np
from jaxtyping import Float

from humanmm.models.evaluation.pose import METRES_TO_MM
from humanmm.models.geometry.alignment import umeyama_alignment
from humanmm.models.geometry.rotations import rotation_angle
from humanmm.models.records.sequence import UndefinedFigureError

CHUNK_FRAMES = 100
"""Length of the chunks that are aligned on their own (SLAHMR's protocol, kept by WHAM, GVHMR and TRAM)."""

SHORTEST_PATH_M = 1e-3
"""A truth that moves less than this has no path to divide by."""


def chunked_mpjpe_mm(
    predicted: Float[np.ndarray, "frames joints 3"],
    truth: Float[np.ndarray, "frames joints 3"],
    *,
    align_frames: int | None,
) -> float:
    """Mean joint distance, mm, with one similarity per chunk over its first `align_frames` frames (None: all of them).

    None gives WA-MPJPE, 2 gives W-MPJPE. The short last chunk is kept.
    """
    errors = []
    for start in range(0, len(truth), CHUNK_FRAMES):
        rows = slice(start, start + CHUNK_FRAMES)
        chunk_predicted, chunk_truth = predicted[rows], truth[rows]
        head = slice(None if align_frames is None else align_frames)
        similarity = umeyama_alignment(chunk_predicted[head].reshape(-1, 3), chunk_truth[head].reshape(-1, 3))
        aligned = similarity.apply(chunk_predicted.reshape(-1, 3)).reshape(chunk_truth.shape)
        errors.append(np.linalg.norm(aligned - chunk_truth, axis=-1).mean(axis=-1))
    return METRES_TO_MM * float(np.concatenate(errors).mean())


def root_trajectory_error_m(predicted: Float[np.ndarray, "frames 3"], truth: Float[np.ndarray, "frames 3"]) -> float:
    """Mean distance of the roots, metres, after one rigid motion (scale kept) over the whole sequence."""
    aligned = umeyama_alignment(predicted, truth, with_scale=False, unique=False).apply(predicted)
    return float(np.linalg.norm(aligned - truth, axis=-1).mean())


def path_length_m(root: Float[np.ndarray, "frames 3"]) -> float:
    """Length of the path between consecutive samples, metres."""
    return float(np.linalg.norm(np.diff(root, axis=0), axis=-1).sum())


def root_trajectory_error_pct(predicted: Float[np.ndarray, "frames 3"], truth: Float[np.ndarray, "frames 3"]) -> float:
    """RTE: the root trajectory error as a fraction of the truth's path length, percent."""
    length = path_length_m(truth)
    if length < SHORTEST_PATH_M:
        raise UndefinedFigureError(f"the truth's root moves only {length:.4f} m")
    return 100.0 * root_trajectory_error_m(predicted, truth) / length


def cut_jump_m(
    *,
    root_predicted: Float[np.ndarray, "2 3"],
    root_truth: Float[np.ndarray, "2 3"],
    R_predicted: Float[np.ndarray, "3 3"],
    R_truth: Float[np.ndarray, "3 3"],
) -> float:
    """|R_predᵀ Δp_pred − R_truthᵀ Δp_truth| over the step across a cut, metres; R of the frame before it."""
    step_predicted = R_predicted.T @ (root_predicted[1] - root_predicted[0])
    step_truth = R_truth.T @ (root_truth[1] - root_truth[0])
    return float(np.linalg.norm(step_predicted - step_truth))


def cut_jump_deg(R_predicted: Float[np.ndarray, "2 3 3"], R_truth: Float[np.ndarray, "2 3 3"]) -> float:
    """Angle between the predicted and the true rotation of the root over the step across a cut, degrees."""
    step_predicted = R_predicted[0].T @ R_predicted[1]
    step_truth = R_truth[0].T @ R_truth[1]
    return float(np.degrees(rotation_angle(step_truth.T @ step_predicted)))
