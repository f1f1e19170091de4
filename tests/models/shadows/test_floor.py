"""The floor about a person, rectified: what lies on it comes to lie where it is, and what bodies hide is not seen."""

import numpy as np
import pytest

from humanmm.models.body.body24 import load_body
from humanmm.models.camera.background.ground import HIDDEN
from humanmm.models.shadows.floor import CELL_M, REACH_M, SIDE, PosedOnFloor, seen_floor

FOCAL_PX, HEIGHT_M = 300.0, 2.0
R_LEVEL_CAM = np.array([[1.0, 0, 0], [0, -np.sin(0.5), np.cos(0.5)], [0, -np.cos(0.5), -np.sin(0.5)]])
"""A camera that looks along +y, and down by 0.5 radians."""
K = np.array([[FOCAL_PX, 0, 160], [0, FOCAL_PX, 120], [0, 0, 1]])


def standing(picture: np.ndarray) -> PosedOnFloor:
    """Somebody in rest pose, four metres away."""
    upright = load_body().rest_joints(np.zeros(10)) @ np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    return PosedOnFloor(
        joints=(upright - upright[0])[None],
        pelvis=np.array([[0.0, 4.0, 0.95 - HEIGHT_M]]),
        floor=np.array([-HEIGHT_M]),
        R_level_cam=R_LEVEL_CAM[None],
        K=K[None],
        pictures=[picture],
    )


def spot(x: float, y: float, radius: float = 0.15) -> np.ndarray:
    """A picture of a floor that is dark about a point, (x, y) from below the pelvis."""
    columns, rows = np.meshgrid(np.arange(320) + 0.5, np.arange(240) + 0.5)
    rays = np.stack([(columns - 160) / FOCAL_PX, (rows - 120) / FOCAL_PX, np.ones_like(rows)], axis=-1) @ R_LEVEL_CAM.T
    points = rays * (-HEIGHT_M / np.minimum(rays[..., 2:], -1e-3))
    return np.where(np.hypot(points[..., 0] - x, points[..., 1] - 4.0 - y) < radius, 60, 180).astype(np.uint8)


@pytest.mark.parametrize("at", [(0.9, 0.0), (-0.8, 0.5), (0.7, -0.6)])
def test_a_spot_on_the_floor_comes_to_lie_where_it_is(at: tuple[float, float]) -> None:
    found = seen_floor(standing(spot(*at)))
    dark = np.argwhere(found.log_brightness[0] < -0.5)
    centre = (dark.mean(axis=0)[::-1] + 0.5) * CELL_M - REACH_M
    np.testing.assert_allclose(centre, at, atol=CELL_M)


def test_what_a_body_hides_is_not_seen() -> None:
    clear = seen_floor(standing(spot(9, 9)))
    behind = int((REACH_M + 0.35) / CELL_M)
    legs = clear.seen[0, behind, SIDE // 2 - 3 : SIDE // 2 + 3]
    assert not legs.all() and clear.seen[0, behind, SIDE // 4]
    hidden = spot(9, 9)
    hidden[:, :160] = HIDDEN
    half = seen_floor(standing(hidden))
    assert half.seen.sum() < 0.6 * clear.seen.sum() and not half.seen[0, SIDE // 2, : SIDE // 2 - 3].any()


def test_a_picture_that_shows_no_floor_says_nothing() -> None:
    found = seen_floor(standing(np.full((240, 320), HIDDEN, np.uint8)))
    assert not found.seen.any() and not found.log_brightness.any()


def test_the_floor_is_seen_from_above_at_its_angle() -> None:
    assert standing(spot(0, 0)).depression == pytest.approx(np.arctan2(2.0, 4.0))
