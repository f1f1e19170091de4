"""Foreign cameras see the same pixels after they were brought into our axes."""

import numpy as np
from scipy.spatial.transform import Rotation

from humanmm.models.geometry.axes import R_ZUP_YUP, centred_pixels, zup_camera_pose


def test_a_point_is_seen_at_the_same_place_from_both_worlds() -> None:
    rng = np.random.default_rng(0)
    R, t = Rotation.random(5, random_state=0).as_matrix(), rng.normal(size=(5, 3))
    points = rng.normal(size=(5, 3))
    R_world_cam, t_world_cam = zup_camera_pose(R, t)
    theirs = np.einsum("nab,nb->na", R, points) + t
    ours = np.einsum("nba,nb->na", R_world_cam, points @ R_ZUP_YUP.T - t_world_cam)
    np.testing.assert_allclose(ours, theirs, atol=1e-12)


def test_what_was_up_is_up_and_the_axes_stay_right_handed() -> None:
    np.testing.assert_array_equal(R_ZUP_YUP @ [0, 1, 0], [0, 0, 1])
    assert np.linalg.det(R_ZUP_YUP) == 1


def test_the_principal_point_moves_by_half_a_pixel_and_nothing_else() -> None:
    K = np.array([[500.0, 0, 319.5], [0, 500, 239.5], [0, 0, 1]])
    np.testing.assert_array_equal(centred_pixels(K) - K, [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])
