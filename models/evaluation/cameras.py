"""Errors of the recovered cameras: whole trajectory, steps inside shots, rotation across cuts, drift, focal length."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.geometry.alignment import umeyama_alignment
from humanmm.models.geometry.rotations import angle_between_deg, rotation_angle
from humanmm.models.records.sequence import CameraSequence, UndefinedFigureError

SAME_PLACE_M = 1e-6
"""Camera centres closer together than this are one position, to which no similarity can be fitted."""


def known(cameras: CameraSequence) -> Bool[np.ndarray, "frames"]:
    """(F,) true where rotation and centre are finite."""
    return np.asarray(np.isfinite(cameras.R_world_cam).all(axis=(1, 2)) & np.isfinite(cameras.t_world_cam).all(axis=1))


def stands_in_two_places(centres: Float[np.ndarray, "frames 3"]) -> bool:
    """Whether camera centres are two positions: a similarity takes any two to these, so that the ATE says nothing of
    where the cameras stand."""
    elsewhere = centres[np.abs(centres - centres[:1]).max(axis=-1) >= SAME_PLACE_M]
    return len(elsewhere) > 0 and bool(np.abs(elsewhere - elsewhere[0]).max() < SAME_PLACE_M)


def absolute_trajectory_error_m(
    predicted: Float[np.ndarray, "frames 3"], truth: Float[np.ndarray, "frames 3"]
) -> float:
    """ATE: root mean square distance of the camera centres, metres, after one similarity over the whole video."""
    if len(truth) < 2 or np.ptp(truth, axis=0).max() < SAME_PLACE_M:
        raise UndefinedFigureError("the true camera never moves, so no similarity can be fitted")
    aligned = umeyama_alignment(predicted, truth, unique=False).apply(predicted)
    return float(np.sqrt(((aligned - truth) ** 2).sum(axis=-1).mean()))


def errors_inside_shots_m(
    predicted: CameraSequence,
    truth: CameraSequence,
    *,
    shots: Sequence[tuple[int, int]],
    usable: Bool[np.ndarray, "frames"],
) -> tuple[float, float]:
    """ATE and RPE of the translation (1-frame steps), metres, each shot after a similarity of its own: what papers on
    odometry give. Mean over the shots whose true camera moves."""
    ate, rpe = [], []
    for start, end in shots:
        rows = np.flatnonzero(usable[start:end]) + start
        true = truth.t_world_cam[rows]
        if len(rows) < 3 or np.ptp(true, axis=0).max() < SAME_PLACE_M:
            continue
        own = predicted.t_world_cam[rows]
        aligned = umeyama_alignment(own, true, unique=False).apply(own)
        ate.append(np.sqrt(((aligned - true) ** 2).sum(axis=-1).mean()))
        apart = (np.diff(aligned, axis=0) - np.diff(true, axis=0))[np.diff(rows) == 1]
        rpe.append(np.sqrt((apart**2).sum(axis=-1).mean()))
    if not ate:
        raise UndefinedFigureError("the true camera moves in no shot")
    return float(np.mean(ate)), float(np.mean(rpe))


def relative_pose_errors(
    predicted: CameraSequence,
    truth: CameraSequence,
    *,
    shots: Sequence[tuple[int, int]],
    usable: Bool[np.ndarray, "frames"],
) -> tuple[float, float]:
    """RPE over 1-frame steps inside shots, (degrees, metres): rmse of each shot, mean over shots; no scale fitted."""
    rotation_deg, translation_m = [], []
    for start, end in shots:
        steps = start + np.flatnonzero(usable[start:end][:-1] & usable[start:end][1:])
        if len(steps) == 0:
            continue
        R_predicted, t_predicted = _steps(predicted, steps)
        R_truth, t_truth = _steps(truth, steps)
        R_truth_T = np.swapaxes(R_truth, -1, -2)
        angles = np.degrees(rotation_angle(R_truth_T @ R_predicted))
        offsets = (R_truth_T @ (t_predicted - t_truth)[..., None])[..., 0]
        rotation_deg.append(np.sqrt((angles**2).mean()))
        translation_m.append(np.sqrt((offsets**2).sum(axis=-1).mean()))
    if not rotation_deg:
        raise UndefinedFigureError("no shot has two consecutive frames with a known camera on both sides")
    return float(np.mean(rotation_deg)), float(np.mean(translation_m))


def frames_beside(transition: tuple[int, int], num_frames: int) -> tuple[int, int]:
    """The last frame before a transition [start, end) and the first after it, or the video's own ends.

    In which frame of a dissolve one camera follows the other is nobody's error of rotation.
    """
    start, end = transition
    return max(start - 1, 0), min(end, num_frames - 1)


def rotation_across(cameras: CameraSequence, transition: tuple[int, int]) -> Float[np.ndarray, "3 3"]:
    """R_before_after of the cameras on both sides of a transition."""
    before, after = frames_beside(transition, len(cameras.R_world_cam))
    return np.asarray(cameras.R_world_cam[before].T @ cameras.R_world_cam[after])


def cut_rotation_errors_deg(
    predicted: CameraSequence,
    truth: CameraSequence,
    *,
    transitions: Sequence[tuple[int, int]],
    usable: Bool[np.ndarray, "frames"],
) -> list[float | None]:
    """Error of `rotation_across` at each of the truth's transitions, degrees; None where it is not known, or where
    `usable` ends before the transition does."""
    errors: list[float | None] = []
    for transition in transitions:
        before, after = frames_beside(transition, len(usable))
        if before < after and usable[before] and usable[after]:
            across = [rotation_across(cameras, transition) for cameras in (predicted, truth)]
            errors.append(angle_between_deg(*across))
        else:
            errors.append(None)
    return errors


def shot_drift_deg(
    predicted: CameraSequence,
    truth: CameraSequence,
    *,
    shots: Sequence[tuple[int, int]],
    usable: Bool[np.ndarray, "frames"],
) -> float:
    """Worst error, degrees, of a camera's rotation against its own shot's first frame."""
    worst = []
    for start, end in shots:
        frames = np.flatnonzero(usable[start:end]) + start
        if len(frames) == 0:
            continue
        R_predicted = predicted.R_world_cam[frames[0]].T @ predicted.R_world_cam[frames]
        R_truth = truth.R_world_cam[frames[0]].T @ truth.R_world_cam[frames]
        worst.append(np.degrees(rotation_angle(np.swapaxes(R_truth, -1, -2) @ R_predicted)).max())
    if not worst:
        raise UndefinedFigureError("no frame has a known camera on both sides")
    return float(max(worst))


def focal_error_pct(K_predicted: Float[np.ndarray, "frames 3 3"], K_truth: Float[np.ndarray, "frames 3 3"]) -> float:
    """Mean absolute error of the focal length (mean of fx and fy), percent of the true one."""
    focal_predicted = 0.5 * (K_predicted[:, 0, 0] + K_predicted[:, 1, 1])
    focal_truth = 0.5 * (K_truth[:, 0, 0] + K_truth[:, 1, 1])
    usable = np.isfinite(focal_predicted) & np.isfinite(focal_truth) & (focal_truth > 0)
    if not usable.any():
        raise UndefinedFigureError("no frame has a known focal length on both sides")
    return 100.0 * float(np.abs(focal_predicted[usable] / focal_truth[usable] - 1.0).mean())


def _steps(
    cameras: CameraSequence, frames: np.ndarray
) -> tuple[Float[np.ndarray, "steps 3 3"], Float[np.ndarray, "steps 3"]]:
    """Pose of each next camera in the axes of this one: inverse(T_world_cam[i]) T_world_cam[i + 1]."""
    R_cam_world = np.swapaxes(cameras.R_world_cam[frames], -1, -2)
    travelled = cameras.t_world_cam[frames + 1] - cameras.t_world_cam[frames]
    return R_cam_world @ cameras.R_world_cam[frames + 1], (R_cam_world @ travelled[..., None])[..., 0]
