"""Foot sliding and the F1 of contacts: known answers."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.evaluation.contacts import contact_f1, foot_sliding_mm, slow_steps, standing_steps
from humanmm.models.records.sequence import MotionSequence, UndefinedFigureError

FRAME = np.array([0, 1, 2, 5, 6])


def test_a_step_stands_where_both_its_frames_do_and_follow_each_other() -> None:
    contacts = np.array([[1.0, 1.0], [1.0, 0.2], [0.6, 1.0], [1.0, 1.0], [1.0, 1.0]])
    assert standing_steps(contacts, FRAME).tolist() == [[True, False], [True, False], [False, False], [True, True]]


def test_a_foot_stands_below_the_speed_limit() -> None:
    feet = np.zeros((5, 2, 3))
    feet[:, 1, 0] = 0.02 * np.arange(5)  # 0.6 m/s at 30 Hz
    assert slow_steps(feet, FRAME, fps=30.0).tolist() == [[True, False], [True, False], [False, False], [True, False]]
    assert slow_steps(feet, FRAME, fps=10.0)[0].tolist() == [True, True]


def test_sliding_is_the_mean_path_of_the_standing_feet() -> None:
    feet = np.zeros((3, 1, 3))
    feet[1, 0, 0], feet[2, 0, 0] = 0.003, 0.004
    assert foot_sliding_mm(feet, np.ones((2, 1), bool)) == pytest.approx(2.0)


def test_without_a_standing_foot_the_figure_is_undefined() -> None:
    with pytest.raises(UndefinedFigureError, match="no foot standing"):
        foot_sliding_mm(np.zeros((3, 1, 3)), np.zeros((2, 1), bool))


def test_contacts_are_scored_where_the_prediction_is_observed(sequence: MotionSequence) -> None:
    person = sequence.people[0]
    true = np.zeros((len(person.frame), 4))
    true[::2] = 1.0
    truth = replace(sequence, people=(replace(person, contacts=true),))
    assert contact_f1(truth, truth) == 1.0
    always = replace(person, contacts=np.ones_like(true))
    recall_of_all = 2 * true.mean() / (1 + true.mean())
    assert contact_f1(replace(sequence, people=(always,)), truth) == pytest.approx(recall_of_all)
    on_even = replace(always, observed=np.arange(len(person.frame)) % 2 == 0)
    assert contact_f1(replace(sequence, people=(on_even,)), truth) == 1.0


def test_without_contacts_in_the_truth_there_is_no_f1(sequence: MotionSequence) -> None:
    nothing = replace(sequence, people=(replace(sequence.people[0], contacts=None),))
    with pytest.raises(UndefinedFigureError, match="no contacts"):
        contact_f1(sequence, nothing)


def test_the_contacts_of_somebody_who_is_not_found_are_missed(sequence: MotionSequence) -> None:
    person = sequence.people[0]
    assert person.contacts is not None and person.bbox_xyxy is not None
    aside = replace(person, person=1, bbox_xyxy=person.bbox_xyxy + np.array([900.0, 0.0, 900.0, 0.0]))
    truth = replace(sequence, people=(person, aside))
    assert contact_f1(sequence, truth) == pytest.approx(2 / 3), "all precise, half of them found"
    assert contact_f1(truth, truth) == 1.0
    silent = replace(sequence, people=(replace(person, contacts=None),))
    with pytest.raises(UndefinedFigureError, match="no contacts"):
        contact_f1(silent, truth)


def test_without_boxes_the_only_person_is_the_only_person(sequence: MotionSequence) -> None:
    bare = replace(sequence, people=(replace(sequence.people[0], bbox_xyxy=None),))
    assert contact_f1(bare, sequence) == 1.0
