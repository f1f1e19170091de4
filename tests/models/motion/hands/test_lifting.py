"""Round trips: angles → landmarks, turned, with noise → angles."""

import numpy as np
import pytest
from hand_points import landmarks_of, random_angles

from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.hands.finger_joints import AT_EASE, HIGHEST, LOWEST, finger_directions
from humanmm.models.motion.hands.lifting import finger_angles, palm_rotation


def _errors_deg(side: int, noise_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Of the bones' directions and of the palm."""
    rng, count = np.random.default_rng(side), 200
    angles = random_angles(count, seed=side)
    points = landmarks_of(side, angles) + rng.normal(0, noise_m, (count, 21, 3))
    R = rotvec_to_rotmat(rng.normal(size=(count, 3)))
    points = 1.3 * np.einsum("nab,nkb->nka", R, points) + rng.normal(size=(count, 1, 3))
    found = finger_angles(points, side)
    assert (found >= LOWEST).all() and (found <= HIGHEST).all()
    cosine = (finger_directions(side, found) * finger_directions(side, angles)).sum(-1)
    between = np.swapaxes(R, 1, 2) @ palm_rotation(points, side)
    palm = np.arccos(np.clip((np.trace(between, axis1=1, axis2=2) - 1) / 2, -1, 1))
    return np.rad2deg(np.arccos(np.clip(cosine, -1, 1))), np.rad2deg(palm)


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize(("noise_mm", "limit_deg", "palm_deg"), [(0, 4, 0.01), (2, 6, 4), (4, 10, 7)])
def test_angles_come_back_up_to_the_pull_of_the_prior(
    side: int, noise_mm: float, limit_deg: float, palm_deg: float
) -> None:
    bones, palm = _errors_deg(side, noise_mm / 1000)
    assert np.median(bones) < limit_deg
    assert np.median(palm) < palm_deg


def test_a_hand_at_ease_comes_back_exactly() -> None:
    for side in (0, 1):
        found = finger_angles(landmarks_of(side, AT_EASE[None]), side)
        np.testing.assert_allclose(found[0], AT_EASE, atol=1e-6)


def test_no_hand_at_all_gives_no_angles() -> None:
    assert finger_angles(np.zeros((0, 21, 3)), 0).shape == (0, 5, 5)
