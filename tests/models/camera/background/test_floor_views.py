"""Two pictures of one floor tell how their cameras stand to each other, from any side; of two floors nothing."""

import math
from dataclasses import replace

import numpy as np
import pytest
from drawn_floor import carpet, picture, tiles

from humanmm.models.camera.background.floor_views import (
    LEAST_COMMON_PX,
    FloorFeatures,
    FloorMotion,
    floor_features,
    floor_motions,
    floor_rotation,
)
from humanmm.models.camera.background.ground import HIDDEN
from humanmm.models.geometry.rotations import rotation_angle, rotvec_to_rotmat

K = np.array([[420.0, 0, 320], [0, 420, 180], [0, 0, 1]])


def pose(azimuth_deg: float, away: float = 4.0, height: float = 1.5) -> tuple[np.ndarray, np.ndarray]:
    """R_level_cam and centre of a camera that looks at the origin, level axes being the world's."""
    azimuth = math.radians(azimuth_deg)
    centre = np.array([away * math.cos(azimuth), away * math.sin(azimuth), height])
    z = -centre / np.linalg.norm(centre)
    x = np.cross(z, [0, 0, 1.0]) / np.linalg.norm(np.cross(z, [0, 0, 1.0]))
    return np.stack([x, np.cross(z, x), z], axis=1), centre


def seen(azimuth_deg: float, floor: np.ndarray, *, height: float = 1.5, turned_deg: float = 0.0) -> FloorFeatures:
    """The floor's features by a camera whose height is thought to be `height`, in level axes turned by so much."""
    R, centre = pose(azimuth_deg)
    turn = math.radians(turned_deg)
    turned = np.array([[math.cos(turn), math.sin(turn), 0], [-math.sin(turn), math.cos(turn), 0], [0, 0, 1]])
    found = floor_features(picture(floor, K, R, centre), K, turned @ R, height)
    assert found is not None
    return found


def off_deg(motion: FloorMotion, heading_deg: float) -> float:
    return abs(math.degrees(math.remainder(motion.heading - math.radians(heading_deg), 2 * math.pi)))


@pytest.mark.parametrize("azimuth_deg", [40.0, 90.0, 180.0])
def test_cameras_on_different_sides_find_each_other_by_the_floor(azimuth_deg: float) -> None:
    a, b = seen(0.0, carpet()), seen(azimuth_deg, carpet(), turned_deg=25.0)
    best = floor_motions(a, b)[0]
    assert best.num_inliers >= 20 and best.correlation > 0.4
    assert off_deg(best, 25.0) < 1.0 and best.scale == pytest.approx(1.0, abs=0.03)
    way = pose(azimuth_deg)[1] - pose(0.0)[1]  # level axes of a are the world's
    assert np.linalg.norm(best.shift - way[:2]) < 0.15


def test_a_height_that_is_wrong_scales_the_floor() -> None:
    best = floor_motions(seen(0.0, carpet()), seen(60.0, carpet(), height=1.65))[0]
    assert off_deg(best, 0.0) < 1.0 and best.scale == pytest.approx(1 / 1.1, abs=0.03)


def test_matches_put_verticals_right() -> None:
    """Both cameras' verticals are off by three degrees, until the rotation is solved."""
    floor, tilts = carpet(), [rotvec_to_rotmat(np.radians([3.0, 0, 0])), rotvec_to_rotmat(np.radians([0, -3.0, 0]))]
    features = []
    for tilt, azimuth_deg in zip(tilts, (0.0, 60.0), strict=True):
        R, centre = pose(azimuth_deg)
        found = floor_features(picture(floor, K, R, centre), K, tilt @ R, 1.5)
        assert found is not None
        features.append(found)
    motion = floor_motions(*features)[0]
    solved, sigma_rad = floor_rotation(motion, (1.5, 1.5), (math.radians(4), math.radians(4)))
    level = rotvec_to_rotmat(np.array([0, 0, motion.heading]))
    right = tilts[0] @ tilts[1].T
    before_deg, after_deg = (math.degrees(float(rotation_angle(right.T @ R))) for R in (level, solved))
    assert after_deg < 1.0 < 2.0 < before_deg
    assert math.degrees(sigma_rad) < 2.0
    _, unsure_rad = floor_rotation(replace(motion, points=motion.points[:, :4]), (1.5, 1.5), (0.07, 0.07))
    assert unsure_rad > 2 * sigma_rad


def test_other_floors_tell_next_to_nothing() -> None:
    found = floor_motions(seen(0.0, carpet(1)), seen(90.0, carpet(7)))
    assert max((one.num_inliers for one in found), default=0) < 7
    assert all(abs(one.correlation) < 0.3 for one in found)


def test_of_tiles_the_right_motion_correlates_best() -> None:
    floor = tiles(noise=25.0)
    found = floor_motions(seen(0.0, floor), seen(50.0, floor))
    best = max(found, key=lambda one: one.correlation)
    assert off_deg(best, 0.0) < 3.0 and best.correlation > 0.5


def test_people_and_the_sky_are_not_the_floor() -> None:
    R, centre = pose(0.0)
    whole = picture(carpet(), K, R, centre)
    hidden = whole.copy()
    hidden[180:, 250:390] = HIDDEN
    every, some = (floor_features(one, K, R, 1.5) for one in (whole, hidden))
    assert every is not None and some is not None
    behind = np.abs(some.xy[:, 1]) < 0.1  # the column of the picture that is hidden looks along x
    assert not behind[np.linalg.norm(some.xy, axis=1) < 3.5].any()
    assert (np.abs(every.xy[:, 1]) < 0.1).any()
    upwards = looking_up(R)
    assert floor_features(whole, K, upwards, 1.5) is None


def looking_up(R: np.ndarray) -> np.ndarray:
    """The same camera looking up by 60° more."""
    pitch = math.radians(60)
    return R @ np.array([[1, 0, 0], [0, math.cos(pitch), -math.sin(pitch)], [0, math.sin(pitch), math.cos(pitch)]])


def test_a_plain_floor_has_no_features() -> None:
    R, _ = pose(0.0)
    assert floor_features(np.full((360, 640), 120, np.uint8), K, R, 1.5) is None


def test_floors_that_hardly_overlap_are_not_compared() -> None:
    a, b = seen(0.0, carpet()), seen(40.0, carpet())
    little = np.zeros_like(b.pattern.shown)
    little[:, : LEAST_COMMON_PX // (2 * len(little))] = 1
    narrow = replace(b, pattern=replace(b.pattern, shown=little))
    assert [one.correlation for one in floor_motions(a, narrow)] == [0.0] * len(floor_motions(a, narrow))
