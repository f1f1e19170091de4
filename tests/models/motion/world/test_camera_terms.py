"""Cameras that are one camera."""

import numpy as np
from walker import EDGE, scene

from humanmm.models.motion.world.problem import SameCamera, ShotRig
from humanmm.models.motion.world.solver import solve


def test_a_static_camera_that_returns_is_at_its_old_place() -> None:
    trajectories, rigs, _ = scene(noise=0.03, cut=20, num_frames=60)
    first = ShotRig(np.zeros((20, 3)), 0, 1.0, scale_known=True)
    solution = solve(trajectories, [first, rigs[1]], [EDGE], [SameCamera(0, 0, 1, 40)])
    assert np.linalg.norm(solution.origin[0] - solution.origin[1]) < 0.1
