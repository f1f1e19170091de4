"""The direction of the light is that of the shadow; a floor without a shadow names none."""

import numpy as np
import pytest

from humanmm.models.body.body24 import load_body
from humanmm.models.shadows.floor import SIDE, PosedOnFloor, SeenFloor
from humanmm.models.shadows.light import AZIMUTHS_DEG, ELEVATIONS_DEG, cast_shadows, light_log_likelihood


def standing() -> PosedOnFloor:
    """Somebody in rest pose in three pictures, each time turned a little."""
    upright = load_body().rest_joints(np.zeros(10)) @ np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    joints = []
    for angle in (0.0, 0.3, 0.6):
        c, s = np.cos(angle), np.sin(angle)
        joints.append((upright - upright[0]) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]]))
    eye = np.tile(np.eye(3), (3, 1, 1))
    blank = [np.zeros((1, 1), np.uint8)] * 3
    return PosedOnFloor(np.array(joints), np.tile([0.0, 4, -1], (3, 1)), np.full(3, -1.95), eye, eye, blank)


def floor(azimuth: float, elevation: float, darker: float = 0.4) -> SeenFloor:
    """A floor with a pattern on which that light casts the shadow; a part of it is hidden."""
    random = np.random.default_rng(3)
    pattern = np.kron(random.normal(0, 0.1, (SIDE // 2, SIDE // 2)), np.ones((2, 2)))
    shadow = cast_shadows(standing(), azimuth, elevation)
    seen = np.ones((3, SIDE, SIDE), bool)
    seen[:, :, SIDE // 2 - 3 : SIDE // 2] = False
    value = pattern + random.normal(0, 0.05, (3, SIDE, SIDE)) - darker * shadow
    return SeenFloor(np.where(seen, value, 0.0), seen)


def test_a_shadow_lies_away_from_the_light_and_is_as_long_as_it_is_low() -> None:
    lengths = []
    for elevation in (43.0, 70.0):
        (mask, *_) = cast_shadows(standing(), np.pi / 2, np.radians(elevation))  # from +y: towards the first rows
        rows = np.flatnonzero(mask.any(axis=1))
        assert rows.mean() < SIDE / 2
        lengths.append(SIDE / 2 - rows.min())
    assert lengths[0] > 1.5 * lengths[1]


@pytest.mark.parametrize(("azimuth", "elevation"), [(2, 2), (9, 3), (17, 4), (22, 1)])
def test_the_light_that_cast_the_shadow_is_the_likeliest(azimuth: int, elevation: int) -> None:
    seen = floor(np.radians(AZIMUTHS_DEG[azimuth]), np.radians(ELEVATIONS_DEG[elevation]))
    found = light_log_likelihood(standing(), seen)
    assert np.unravel_index(int(found.argmax()), found.shape) == (azimuth, elevation)
    opposite = found[(azimuth + len(AZIMUTHS_DEG) // 2) % len(AZIMUTHS_DEG)]
    assert found.max() > opposite.max() + 5


def test_a_floor_without_a_shadow_and_one_that_is_brighter_there_name_no_light() -> None:
    assert light_log_likelihood(standing(), floor(1.0, 0.8, darker=0.0)).max() < 3
    assert light_log_likelihood(standing(), floor(1.0, 0.8, darker=-0.4))[4, 3] == pytest.approx(0.0, abs=0.5)


def test_nothing_seen_says_nothing() -> None:
    nothing = SeenFloor(np.zeros((3, SIDE, SIDE)), np.zeros((3, SIDE, SIDE), bool))
    assert not light_log_likelihood(standing(), nothing).any()
