"""Who in the prediction is who in the truth: one to one, by the overlap of the 2D boxes over the whole video."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float
from scipy.optimize import linear_sum_assignment

from humanmm.models.geometry.boxes import box_iou
from humanmm.models.geometry.projection import in_front, project, world_to_camera
from humanmm.models.records.sequence import CameraSequence, MotionSequence, PersonSequence

NEAR_M = 0.1
"""Joints nearer to the camera's plane than this are not seen."""
SAME_BOX = 0.5
"""IoU from which a predicted box is a true one."""
LEAST_MEAN_IOU = 0.1
"""A pair whose boxes overlap less than this over their common frames is not the same person."""


def match_people(predicted: Sequence[PersonSequence], truth: Sequence[PersonSequence]) -> dict[int, int]:
    """Index of the predicted person for each index of a truth's person that found one.

    The assignment has the greatest sum of box IoU over all frames, so that somebody seen for long weighs more.
    """
    total = np.zeros((len(truth), len(predicted)))
    mean = np.zeros_like(total)
    for row, true_person in enumerate(truth):
        for column, predicted_person in enumerate(predicted):
            overlaps = _overlaps(predicted_person, true_person)
            if len(overlaps):
                total[row, column], mean[row, column] = overlaps.sum(), overlaps.mean()
    rows, columns = linear_sum_assignment(total, maximize=True)
    return {int(r): int(c) for r, c in zip(rows, columns, strict=True) if mean[r, c] >= LEAST_MEAN_IOU}


def match_sequences(prediction: MotionSequence, truth: MotionSequence) -> dict[int, int]:
    """As `match_people`; where a side has no boxes, its only person is the other's only person."""
    return {0: 0} if alone_without_boxes(prediction, truth) else match_people(prediction.people, truth.people)


def alone_without_boxes(prediction: MotionSequence, truth: MotionSequence) -> bool:
    """Whether there is one person on both sides, and nothing to match them by."""
    sides = (prediction, truth)
    return all(len(side.people) == 1 for side in sides) and any(side.people[0].bbox_xyxy is None for side in sides)


def identity_f1(predicted: Sequence[PersonSequence], truth: Sequence[PersonSequence]) -> float:
    """IDF1 (Ristani et al., ECCV workshops 2016): the F1 of boxes that bear one identity throughout, 0..1.

    A box is found where its IoU with the truth's is at least SAME_BOX; identities are matched one to one so that most
    boxes are. Boxes count in frames in which the person is observed. Nobody to find and nobody found is 1.
    """
    found = np.array(
        [[(_overlaps(one, true, observed=True) >= SAME_BOX).sum() for one in predicted] for true in truth]
    ).reshape(len(truth), len(predicted))
    boxes = sum(int(person.observed.sum()) for person in (*predicted, *truth))
    rows, columns = linear_sum_assignment(found, maximize=True)
    return 2.0 * float(found[rows, columns].sum()) / boxes if boxes else 1.0


def projected_boxes(
    joints: Float[np.ndarray, "frames joints 3"], frame: np.ndarray, cameras: CameraSequence
) -> Float[np.ndarray, "frames 4"]:
    """(N,4) xyxy around the joints as the cameras see them (no distortion); NaN where fewer than three are in front."""
    in_camera = world_to_camera(joints, cameras.R_world_cam[frame], cameras.t_world_cam[frame])
    pixels = project(in_camera, cameras.K[frame], near_m=NEAR_M)
    visible = (in_front(in_camera, NEAR_M) & np.isfinite(pixels).all(axis=-1))[..., None]
    boxes = np.concatenate(
        [np.where(visible, pixels, np.inf).min(axis=1), np.where(visible, pixels, -np.inf).max(axis=1)], axis=1
    )
    boxes[visible[..., 0].sum(axis=1) < 3] = np.nan
    return boxes


def _overlaps(one: PersonSequence, other: PersonSequence, *, observed: bool = False) -> Float[np.ndarray, "frames"]:
    """IoU in the frames in which both have a box; `observed`: only where both are observed."""
    if one.bbox_xyxy is None or other.bbox_xyxy is None:
        return np.zeros(0)
    _, i, j = np.intersect1d(one.frame, other.frame, assume_unique=True, return_indices=True)
    one_xyxy, other_xyxy = one.bbox_xyxy[i], other.bbox_xyxy[j]
    usable = _is_box(one_xyxy) & _is_box(other_xyxy)
    if observed:
        usable &= one.observed[i] & other.observed[j]
    return box_iou(one_xyxy[usable], other_xyxy[usable])


def _is_box(bbox_xyxy: Float[np.ndarray, "frames 4"]) -> Bool[np.ndarray, "frames"]:
    """(N,) true where the box is known and holds something."""
    return np.asarray(np.isfinite(bbox_xyxy).all(axis=1) & (bbox_xyxy[:, 2:] > bbox_xyxy[:, :2]).all(axis=1))
