"""Root errors after cuts: nothing for a perfect prediction, how far a shot is away for one that is joined wrongly."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.evaluation.after_cuts import anchor_mpjpe_mm, root_errors_after_cuts_m
from humanmm.models.geometry.alignment import yaw_to_rotmat
from humanmm.models.records.sequence import MotionSequence, UndefinedFigureError


def moved(sequence: MotionSequence, R: np.ndarray, shift: np.ndarray, *, start: int) -> MotionSequence:
    """The person of the frames from `start` on, somewhere else."""
    person = sequence.people[0]
    joints = person.joints.copy()
    joints[start:] = joints[start:] @ R.T + shift
    return replace(sequence, people=(replace(person, joints=joints),))


def test_a_rigid_motion_of_everything_is_no_error(sequence: MotionSequence) -> None:
    (error,) = root_errors_after_cuts_m(moved(sequence, yaw_to_rotmat(1.0), np.array([3.0, 0, 0]), start=0), sequence)
    assert error == pytest.approx(0, abs=1e-6)


def test_a_shot_that_lies_elsewhere_is_as_far_away_as_it_is(sequence: MotionSequence) -> None:
    cut = sequence.cut_frames[0]
    (error,) = root_errors_after_cuts_m(moved(sequence, np.eye(3), np.array([0, 0.7, 0]), start=cut), sequence)
    assert error == pytest.approx(0.7, abs=1e-6)


def test_an_unlinked_cut_and_one_that_nobody_crosses_have_no_error(sequence: MotionSequence) -> None:
    cut = sequence.cut_frames[0]
    assert root_errors_after_cuts_m(sequence, replace(sequence, unlinked_cuts=(cut,))) == [None]
    person = sequence.people[0]
    first = replace(
        person, frame=person.frame[:cut], observed=person.observed[:cut], joints=person.joints[:cut],
        bbox_xyxy=None if person.bbox_xyxy is None else person.bbox_xyxy[:cut],
    )  # fmt: skip
    assert root_errors_after_cuts_m(replace(sequence, people=(first,)), sequence) == [None]


def test_the_first_shot_is_the_anchor_of_all_others(sequence: MotionSequence) -> None:
    cut = sequence.cut_frames[0]
    whole = moved(sequence, yaw_to_rotmat(1.0), np.array([3.0, 0, 0]), start=0)
    assert anchor_mpjpe_mm(whole, sequence) == pytest.approx(0, abs=1e-3)
    assert anchor_mpjpe_mm(moved(whole, np.eye(3), np.array([0, 0.7, 0]), start=cut), sequence) == pytest.approx(700)
    person = sequence.people[0]
    late = replace(
        person, frame=person.frame[cut:], observed=person.observed[cut:], joints=person.joints[cut:],
        bbox_xyxy=None if person.bbox_xyxy is None else person.bbox_xyxy[cut:],
    )  # fmt: skip
    with pytest.raises(UndefinedFigureError, match="first shot"):
        anchor_mpjpe_mm(replace(sequence, people=(late,)), sequence)
