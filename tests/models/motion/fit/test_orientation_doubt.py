"""Bodies turned the wrong way: doubted where the lifter does not know, or says something else than the fit."""

import numpy as np

from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.fit.orientation_doubt import USUAL, misoriented
from humanmm.models.records.tracks import UNKNOWN_RAD


def about_the_vertical(angles_deg: list[float]) -> np.ndarray:
    return rotvec_to_rotmat(np.outer(np.deg2rad(angles_deg), [0.0, 1.0, 0.0]))


def test_doubt_grows_with_the_lifters_uncertainty_and_with_its_distance_from_the_fit() -> None:
    upright, sigma = np.tile(np.eye(3), (4, 1, 1)), np.deg2rad([8.0, 8.0, 8.0, 8.0])
    by_gap = misoriented(upright, about_the_vertical([0, 15, 40, 120]), sigma)
    by_sigma = misoriented(upright, about_the_vertical([5, 5, 5, 5]), np.deg2rad([6.0, 12.0, 30.0, 60.0]))
    assert (np.diff(by_gap) > 0).all() and (np.diff(by_sigma) > 0).all()
    assert by_gap[0] < 0.02
    assert by_gap[-1] > 0.3


def test_a_frame_of_which_the_lifter_says_nothing_is_as_doubtful_as_most() -> None:
    far = misoriented(np.eye(3)[None], about_the_vertical([170]), np.array([UNKNOWN_RAD]))
    assert far[0] == USUAL
