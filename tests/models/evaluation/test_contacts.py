"""Foot sliding: known answers."""

import numpy as np
import pytest

from humanmm.models.evaluation.contacts import foot_sliding_mm, slow_steps, standing_steps
from humanmm.models.records.sequence import UndefinedFigureError

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
