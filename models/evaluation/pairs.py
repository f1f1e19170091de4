"""One person on both sides of an evaluation, cut down to the frames and joints that both have."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from humanmm.models.evaluation.orientation import orientation_from_joints
from humanmm.models.evaluation.people import match_people
from humanmm.models.evaluation.skeleton import is_full, mid_hip, pick, shared_names
from humanmm.models.records.sequence import MotionSequence, PersonSequence, UndefinedFigureError

FLAT_M = 1e-6
"""Joints whose second singular value about their mean is smaller lie on one line, or in one position."""


@dataclass(frozen=True)
class Pair:
    """N common frames, J shared joints."""

    frame: np.ndarray
    """(N,) source frames, strictly increasing."""
    joint_names: tuple[str, ...]
    predicted: PersonSequence
    truth: PersonSequence
    rows_predicted: np.ndarray
    """(N,) rows of the common frames in the predicted sequence's arrays."""
    rows_truth: np.ndarray
    joints_predicted: Float[np.ndarray, "frames joints 3"]
    joints_truth: Float[np.ndarray, "frames joints 3"]

    @property
    def about_hips(self) -> tuple[Float[np.ndarray, "frames joints 3"], Float[np.ndarray, "frames joints 3"]]:
        """Joints about the mid-hip, world axes: (predicted, truth)."""
        hips_predicted = mid_hip(self.joints_predicted, self.joint_names)
        hips_truth = mid_hip(self.joints_truth, self.joint_names)
        return self.joints_predicted - hips_predicted[:, None], self.joints_truth - hips_truth[:, None]

    @property
    def roots(self) -> tuple[Float[np.ndarray, "frames 3"], Float[np.ndarray, "frames 3"]]:
        """Pelvis of both sides, or the mid-hip in a partial skeleton: (predicted, truth)."""
        if is_full(self.joint_names):
            pelvis = self.joint_names.index("Pelvis")
            return self.joints_predicted[:, pelvis], self.joints_truth[:, pelvis]
        return mid_hip(self.joints_predicted, self.joint_names), mid_hip(self.joints_truth, self.joint_names)

    @property
    def orientations(self) -> tuple[Float[np.ndarray, "frames 3 3"], Float[np.ndarray, "frames 3 3"]]:
        """Body to world: the root joint's rotations, or, where one side has none, from the joints of BOTH."""
        of_predicted, of_truth = self.predicted.R_world_root, self.truth.R_world_root
        if is_full(self.joint_names) and of_predicted is not None and of_truth is not None:
            return of_predicted[self.rows_predicted], of_truth[self.rows_truth]
        return (
            orientation_from_joints(self.joints_predicted, self.joint_names),
            orientation_from_joints(self.joints_truth, self.joint_names),
        )

    def rows_across(self, cut_frame: int) -> list[int] | None:
        """Rows of the last frame before a cut and the first after it; None if one of them is not common."""
        before, after = np.searchsorted(self.frame, [cut_frame - 1, cut_frame])
        if after >= len(self.frame) or self.frame[before] != cut_frame - 1 or self.frame[after] != cut_frame:
            return None
        return [int(before), int(after)]


def known_rows(person: PersonSequence, joint_names: tuple[str, ...], wanted: tuple[str, ...]) -> np.ndarray:
    """Rows in which all wanted joints are finite, and span a plane: others have no best similarity."""
    joints = pick(person.joints, joint_names, wanted).astype(np.float64)
    finite = np.flatnonzero(np.isfinite(joints).all(axis=(1, 2)))
    about_mean = joints[finite] - joints[finite].mean(axis=1, keepdims=True)
    return finite[np.linalg.svd(about_mean, compute_uv=False)[:, 1] > FLAT_M]


def make_pair(
    predicted: PersonSequence,
    truth: PersonSequence,
    *,
    predicted_sequence: MotionSequence,
    truth_sequence: MotionSequence,
) -> Pair:
    """The two sides on common frames and joints. Raises UndefinedFigureError where there are none."""
    names = shared_names(predicted_sequence.joint_names, truth_sequence.joint_names)
    if names is None:
        raise UndefinedFigureError("truth and prediction share neither SMPL's 24 joints nor the twelve limb joints")
    of_predicted = known_rows(predicted, predicted_sequence.joint_names, names)
    of_truth = known_rows(truth, truth_sequence.joint_names, names)
    frame, i, j = np.intersect1d(
        predicted.frame[of_predicted], truth.frame[of_truth], assume_unique=True, return_indices=True
    )
    if len(frame) == 0:
        raise UndefinedFigureError("no frame is in both truth and prediction")
    rows_predicted, rows_truth = of_predicted[i], of_truth[j]
    return Pair(
        frame=frame,
        joint_names=names,
        predicted=predicted,
        truth=truth,
        rows_predicted=rows_predicted,
        rows_truth=rows_truth,
        joints_predicted=pick(predicted.joints[rows_predicted], predicted_sequence.joint_names, names).astype(
            np.float64
        ),
        joints_truth=pick(truth.joints[rows_truth], truth_sequence.joint_names, names).astype(np.float64),
    )


def pairs_of(prediction: MotionSequence, truth: MotionSequence) -> list[Pair]:
    """Everybody of the truth who was found, with whom he was found as; without those who share no frame or joint."""
    pairs = []
    for index, matched in match_people(prediction.people, truth.people).items():
        try:
            pairs.append(
                make_pair(
                    prediction.people[matched], truth.people[index], predicted_sequence=prediction, truth_sequence=truth
                )
            )
        except UndefinedFigureError:
            continue
    return pairs
