"""Properties of the least-squares alignments."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from humanmm.models.geometry.alignment import fit_similarity, fit_yaw, rotation_angle_deg, yaw_rotation
from humanmm.models.geometry.rotations import rotation_from_vector

POINTS = np.random.default_rng(1).normal(size=(24, 3))
vectors = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(np.array)


@settings(max_examples=40, deadline=None)
@given(vectors, vectors, st.floats(0.1, 10.0))
def test_a_similarity_is_found_again(rotation: np.ndarray, translation: np.ndarray, scale: float) -> None:
    moved = scale * POINTS @ rotation_from_vector(rotation).T + translation
    found = fit_similarity(POINTS, moved)
    np.testing.assert_allclose(found.apply(POINTS), moved, atol=1e-9)
    np.testing.assert_allclose(found.scale, scale, rtol=1e-9)


def test_a_mirror_image_is_not_matched_by_a_reflection() -> None:
    found = fit_similarity(POINTS, POINTS * [-1.0, 1.0, 1.0])
    np.testing.assert_allclose(np.linalg.det(found.R_target_source), 1.0)


def test_a_batch_gives_what_its_members_give() -> None:
    source = np.random.default_rng(2).normal(size=(5, 24, 3))
    target = np.random.default_rng(3).normal(size=(5, 24, 3))
    batch = fit_similarity(source, target).apply(source)
    single = [fit_similarity(s, t).apply(s) for s, t in zip(source, target, strict=True)]
    np.testing.assert_allclose(batch, single, atol=1e-12)


def test_the_rigid_fit_keeps_the_size() -> None:
    found = fit_similarity(POINTS, 3.0 * POINTS, with_scale=False)
    assert found.scale == 1.0


@given(st.floats(-3.1, 3.1))
def test_yaw_is_found_again_and_tilt_is_left_alone(yaw: float) -> None:
    tilted = POINTS @ rotation_from_vector([0.0, 0.0, 0.0]).T
    np.testing.assert_allclose(fit_yaw(POINTS, tilted @ yaw_rotation(yaw).T), yaw_rotation(yaw), atol=1e-9)
    assert fit_yaw(POINTS, POINTS @ rotation_from_vector([0.4, 0.0, 0.0]).T)[2, 2] == 1.0


@given(st.floats(1e-7, 3.14))
def test_angles_are_exact_from_tiny_to_half_a_turn(angle: float) -> None:
    R = rotation_from_vector(angle * np.array([0.6, 0.0, 0.8]))
    np.testing.assert_allclose(rotation_angle_deg(R), np.degrees(angle), rtol=1e-6, atol=1e-9)
