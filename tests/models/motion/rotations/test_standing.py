"""How high the floor is above which somebody stands."""

from dataclasses import replace

import numpy as np
from three_shots import results

from humanmm.models.motion.rotations import standing as under_test
from humanmm.models.motion.rotations.shot_results import camera_of
from humanmm.models.motion.rotations.standing import FLOOR_QUANTILE, FLOOR_S


def test_a_camera_that_travels_has_a_floor_in_every_frame_from_those_near_in_time() -> None:
    time_s = np.cumsum(np.random.default_rng(0).choice([1 / 30, 1 / 60, 0.4], 200))
    lowest = -1.5 + 0.1 * np.random.default_rng(1).normal(size=200)
    camera = camera_of(results(), 0)
    going = replace(camera, t_shot_cam=camera.t_shot_cam + np.arange(camera.end - camera.start)[:, None])
    assert going.travels and not camera.travels
    near = np.abs(time_s[:, None] - time_s) <= FLOOR_S
    expected = [np.quantile(lowest[row], FLOOR_QUANTILE) for row in near]
    np.testing.assert_array_equal(under_test._floor_height(lowest, time_s, going), expected)
    whole = under_test._floor_height(lowest, time_s, camera)
    np.testing.assert_array_equal(whole, np.quantile(lowest, FLOOR_QUANTILE))
