"""Where the world begins and how it is headed."""

import numpy as np
from scipy.spatial.transform import Rotation
from walker import EDGE, scene

from humanmm.models.motion.world.align import _at_origin
from humanmm.models.motion.world.solver import solve


def test_the_world_begins_above_the_origin_and_looks_along_y() -> None:
    trajectories, rigs, _ = scene()
    R = Rotation.from_euler("zx", [35, -90], degrees=True).as_matrix()
    solution = _at_origin(solve(trajectories, rigs, [EDGE]), trajectories, R)
    np.testing.assert_allclose(solution.pelvis[0][0, :2], 0, atol=1e-9)
    ahead = solution.rotation[0] @ R[:, 2]
    assert abs(ahead[0]) < 1e-9 and ahead[1] > 0.9
