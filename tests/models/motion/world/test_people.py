"""People of the world, put together from shots."""

import numpy as np

from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.world.people import interpolate_rotmats, rows_before


def test_holes_are_interpolated_along_the_shortest_rotation() -> None:
    known = np.array([3, 4, 8])
    row, fraction = rows_before(known, np.arange(3, 9))
    np.testing.assert_allclose(known[row] + fraction * (np.array([4, 8, 8])[row] - known[row]), np.arange(3, 9))
    R = rotvec_to_rotmat(np.outer([0.0, 0.1, 0.9], [0, 0, 1.0]))
    angle = np.arctan2(interpolate_rotmats(R, row, fraction)[:, 1, 0], interpolate_rotmats(R, row, fraction)[:, 0, 0])
    np.testing.assert_allclose(angle, [0, 0.1, 0.3, 0.5, 0.7, 0.9], atol=1e-9)
