"""Where the world begins and how it is headed, and which change of the focal length is believed."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from three_shots import results
from walker import EDGE, scene

from humanmm.models.motion.world import align as module
from humanmm.models.motion.world.align import _at_origin, align
from humanmm.models.motion.world.solver import solve


def test_the_world_begins_above_the_origin_and_looks_along_y() -> None:
    trajectories, rigs, _ = scene()
    R = Rotation.from_euler("zx", [35, -90], degrees=True).as_matrix()
    solution = _at_origin(solve(trajectories, rigs, [EDGE]), trajectories, R)
    np.testing.assert_allclose(solution.pelvis[0][0, :2], 0, atol=1e-9)
    ahead = solution.rotation[0] @ R[:, 2]
    assert abs(ahead[0]) < 1e-9 and ahead[1] > 0.9


@pytest.mark.parametrize(
    ("wanted", "factor", "dispute", "longer"),
    [(1.02, 1.02, 0.0, [1.0]), (1.15, 1.15, 0.0, [1.0, 1.15]), (1.4, 1.0, np.log(1.4), [1.0, 1.0])],
)
def test_a_change_of_the_focal_length_far_from_its_estimate_is_told_and_not_believed(
    monkeypatch: pytest.MonkeyPatch, wanted: float, factor: float, dispute: float, longer: list[float]
) -> None:
    """The estimate is good to 10 %; `longer`: with which focal lengths everything was decided."""
    given = results()
    given = replace(given, intrinsics=replace(given.intrinsics, source="estimated", relative_uncertainty=0.1))
    solved, used = module._aligned, []

    def counted(shots: Any, *rest: Any, focal: float | None = None) -> Any:
        used.append(shots.intrinsics.focal_px / given.intrinsics.focal_px)
        world = solved(shots, *rest, focal=1.0)
        return world if focal else replace(world, focal_factor=wanted)

    monkeypatch.setattr(module, "_aligned", counted)
    world = align(given)
    assert world.focal_factor == pytest.approx(factor) and world.focal_dispute == pytest.approx(dispute)
    assert used == pytest.approx(longer)
