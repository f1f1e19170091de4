"""The focal length from the edges of a room."""

import numpy as np
import pytest
from room_edges import camera_towards, edges_of_a_room, seen_by

from humanmm.models.camera.background.walls_focal import LARGEST, LOG_SCALES, focal_log_likelihood
from humanmm.models.geometry.intrinsics import K_from_focal, default_focal_px

DEFAULT = default_focal_px(960, 540)


@pytest.mark.parametrize("ratio", [0.75, 1.0, 1.3])
def test_the_focal_length_at_which_walls_stand_at_right_angles_is_likeliest(ratio: float) -> None:
    K = K_from_focal(DEFAULT * ratio, 960, 540)
    ends = seen_by(edges_of_a_room(np.random.default_rng(0), each=25), camera_towards(35.0, 15.0), K, distance_m=6.0)
    likelihood = focal_log_likelihood(ends, DEFAULT, 960, 540)
    assert likelihood is not None
    assert abs(LOG_SCALES[int(likelihood.argmax())] - np.log(ratio)) <= 0.08  # the grid's step is 0.07


def test_no_picture_excludes_a_focal_length() -> None:
    K = K_from_focal(DEFAULT, 960, 540)
    ends = seen_by(edges_of_a_room(np.random.default_rng(1), each=40), camera_towards(35.0, 15.0), K)
    likelihood = focal_log_likelihood(ends, DEFAULT, 960, 540)
    assert likelihood is not None and likelihood.max() == 0 and likelihood.min() >= -LARGEST


def test_a_picture_without_edges_says_nothing() -> None:
    assert focal_log_likelihood(np.zeros((3, 4)), DEFAULT, 960, 540) is None
