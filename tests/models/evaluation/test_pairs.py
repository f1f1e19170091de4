"""Two sides of an evaluation on common frames and joints."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.evaluation.pairs import known_rows, make_pair
from humanmm.models.records.sequence import MotionSequence, UndefinedFigureError


def part(sequence: MotionSequence, rows: np.ndarray) -> MotionSequence:
    person = sequence.people[0]
    return replace(
        sequence,
        people=(replace(person, frame=person.frame[rows], observed=person.observed[rows], joints=person.joints[rows]),),
    )


def test_only_common_frames_with_all_joints_are_paired(sequence: MotionSequence) -> None:
    predicted = part(sequence, np.arange(10, 40))
    joints = predicted.people[0].joints.copy()
    joints[5, 3] = np.nan
    holed = replace(predicted.people[0], joints=joints)
    truth = part(sequence, np.arange(0, 30))
    pair = make_pair(holed, truth.people[0], predicted_sequence=predicted, truth_sequence=truth)
    assert pair.frame.tolist() == [k for k in range(10, 30) if k != 15]
    np.testing.assert_array_equal(pair.joints_predicted, pair.joints_truth)
    np.testing.assert_allclose(pair.about_hips[0][:, 1:3].mean(axis=1), 0.0, atol=1e-12)  # the hips' middle
    assert 15 - 10 not in known_rows(holed, sequence.joint_names, sequence.joint_names)


def test_a_cut_is_crossed_only_where_both_its_frames_are_common(sequence: MotionSequence) -> None:
    truth = part(sequence, np.r_[0:20, 22:30])
    pair = make_pair(sequence.people[0], truth.people[0], predicted_sequence=sequence, truth_sequence=truth)
    assert pair.rows_across(10) == [9, 10]
    assert pair.rows_across(20) is None
    assert pair.rows_across(22) is None


def test_sides_without_a_common_frame_are_refused(sequence: MotionSequence) -> None:
    early, late = part(sequence, np.arange(0, 10)), part(sequence, np.arange(10, 20))
    with pytest.raises(UndefinedFigureError, match="no frame"):
        make_pair(early.people[0], late.people[0], predicted_sequence=early, truth_sequence=late)
