"""Rotations: round trips and known answers."""

import numpy as np
from scipy.spatial.transform import Rotation

from humanmm.models.geometry.rotations import (
    kabsch,
    nearest_rotation,
    quaternion_from_rotation,
    rotation_from_vector,
    skew,
    swing,
    vector_from_rotation,
)

RNG = np.random.default_rng(0)


def test_exponential_map_agrees_with_scipy_from_zero_to_a_full_turn() -> None:
    vectors = RNG.normal(size=(500, 3)) * np.geomspace(1e-12, 3, 500)[:, None]
    np.testing.assert_allclose(rotation_from_vector(vectors), Rotation.from_rotvec(vectors).as_matrix(), atol=1e-12)


def test_logarithm_inverts_the_exponential_map_up_to_half_a_turn() -> None:
    axes = RNG.normal(size=(400, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    vectors = axes * np.concatenate([np.geomspace(1e-10, 3.14, 399), [np.pi - 1e-9]])[:, None]
    np.testing.assert_allclose(vector_from_rotation(rotation_from_vector(vectors)), vectors, atol=1e-7)


def test_quaternions_have_unit_length_and_match_scipy() -> None:
    R = Rotation.random(300, random_state=1).as_matrix()
    q = quaternion_from_rotation(R)
    reference = Rotation.from_matrix(R).as_quat(scalar_first=True)
    np.testing.assert_allclose(np.abs(np.sum(q * reference, axis=1)), 1, atol=1e-12)


def test_skew_is_the_cross_product() -> None:
    a, b = RNG.normal(size=(2, 20, 3))
    np.testing.assert_allclose((skew(a) @ b[..., None])[..., 0], np.cross(a, b), atol=1e-14)


def test_kabsch_finds_the_rotation_between_two_point_sets() -> None:
    R = Rotation.random(10, random_state=2).as_matrix()
    points = RNG.normal(size=(10, 6, 3))
    moved = np.einsum("nab,npb->npa", R, points) + RNG.normal(size=(10, 1, 3))
    np.testing.assert_allclose(kabsch(points, moved, RNG.uniform(0.1, 1, (10, 6))), R, atol=1e-9)


def test_projection_onto_rotations_is_proper_even_for_a_mirror() -> None:
    assert np.linalg.det(nearest_rotation(np.diag([1.0, 1.0, -0.5]))) > 0.999


def test_swing_takes_one_direction_to_the_other_and_survives_opposite_ones() -> None:
    a, b = RNG.normal(size=(2, 50, 3))
    b[0] = -a[0]
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    b /= np.linalg.norm(b, axis=1, keepdims=True)
    np.testing.assert_allclose((swing(a, b) @ a[..., None])[..., 0], b, atol=1e-9)
