"""K puts the optical axis in the middle of the picture, and the default focal length spans 60 degrees."""

import math

import numpy as np

from humanmm.models.geometry.intrinsics import K_from_focal, K_of, default_focal_px
from humanmm.models.records.camera import Intrinsics


def test_the_optical_axis_meets_the_middle_of_the_picture() -> None:
    K = K_from_focal(900.0, 1920, 1080)
    assert (K @ [0.0, 0.0, 2.0] / 2.0).tolist() == [960.0, 540.0, 1.0]
    np.testing.assert_array_equal(K_of(Intrinsics(900.0, 1920, 1080, "given", 0.0)), K)


def test_the_default_focal_length_spans_sixty_degrees_across_the_diagonal() -> None:
    for width, height in ((1920, 1080), (720, 1280)):
        angle = 2 * math.atan(math.hypot(width, height) / 2 / default_focal_px(width, height))
        assert abs(math.degrees(angle) - 60.0) < 0.1
