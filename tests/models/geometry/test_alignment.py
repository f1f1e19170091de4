"""Properties of the least-squares alignments, and agreement with evo's."""

import numpy as np
import pytest
from evo.core import geometry as evo
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from humanmm.models.geometry.alignment import (
    DegenerateAlignmentError,
    kabsch,
    umeyama_alignment,
    yaw_alignment,
    yaw_to_rotmat,
)
from humanmm.models.geometry.rotations import rotvec_to_rotmat

POINTS = np.random.default_rng(1).normal(size=(24, 3))
LINE = np.linspace(0.0, 5.0, 24)[:, None] * [0.6, 0.0, 0.8]
vectors = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(np.array)


@settings(max_examples=40, deadline=None)
@given(vectors, vectors, st.floats(0.1, 10.0))
def test_a_similarity_is_found_again(rotation: np.ndarray, translation: np.ndarray, scale: float) -> None:
    moved = scale * POINTS @ rotvec_to_rotmat(rotation).T + translation
    found = umeyama_alignment(POINTS, moved)
    np.testing.assert_allclose(found.apply(POINTS), moved, atol=1e-9)
    np.testing.assert_allclose(found.scale, scale, rtol=1e-9)


@pytest.mark.parametrize("with_scale", [True, False])
def test_noisy_points_are_aligned_as_by_evo(with_scale: bool) -> None:
    noisy = POINTS * [-1.0, 1.0, 1.0] + np.random.default_rng(2).normal(size=POINTS.shape)
    found = umeyama_alignment(POINTS, noisy, with_scale=with_scale)
    R, t, scale = evo.umeyama_alignment(POINTS.T, noisy.T, with_scale)
    np.testing.assert_allclose(found.R_target_source, R, atol=1e-12)
    np.testing.assert_allclose(found.translation, t, atol=1e-12)
    np.testing.assert_allclose(found.scale, scale, rtol=1e-12)


def test_a_mirror_image_is_not_matched_by_a_reflection() -> None:
    found = umeyama_alignment(POINTS, POINTS * [-1.0, 1.0, 1.0])
    np.testing.assert_allclose(np.linalg.det(found.R_target_source), 1.0)


def test_a_batch_gives_what_its_members_give() -> None:
    source = np.random.default_rng(2).normal(size=(5, 24, 3))
    target = np.random.default_rng(3).normal(size=(5, 24, 3))
    batch = umeyama_alignment(source, target).apply(source)
    single = [umeyama_alignment(s, t).apply(s) for s, t in zip(source, target, strict=True)]
    np.testing.assert_allclose(batch, single, atol=1e-12)


def test_the_rigid_fit_keeps_the_size() -> None:
    found = umeyama_alignment(POINTS, 3.0 * POINTS, with_scale=False)
    assert found.scale == 1.0


@pytest.mark.parametrize("points", [LINE, np.zeros((24, 3))], ids=["a line", "one position"])
def test_points_that_do_not_determine_a_rotation_are_refused(points: np.ndarray) -> None:
    with pytest.raises(DegenerateAlignmentError, match="span a plane"):
        umeyama_alignment(points, POINTS)


def test_distances_to_points_on_a_line_are_determined_all_the_same() -> None:
    moved = 2.0 * LINE @ rotvec_to_rotmat([0.3, 0.2, 0.1]).T + 1.0
    found = umeyama_alignment(LINE, moved, unique=False)
    np.testing.assert_allclose(found.apply(LINE), moved, atol=1e-9)
    assert np.isfinite(umeyama_alignment(np.zeros((24, 3)), POINTS, unique=False).apply(LINE)).all()


def test_kabsch_finds_the_rotation_between_two_point_sets() -> None:
    rng = np.random.default_rng(0)
    R = Rotation.random(10, random_state=2).as_matrix()
    points = rng.normal(size=(10, 6, 3))
    moved = np.einsum("nab,npb->npa", R, points) + rng.normal(size=(10, 1, 3))
    np.testing.assert_allclose(kabsch(points, moved, rng.uniform(0.1, 1, (10, 6))), R, atol=1e-9)


@given(st.floats(-3.1, 3.1))
def test_yaw_is_found_again_and_tilt_is_left_alone(yaw: float) -> None:
    np.testing.assert_allclose(yaw_alignment(POINTS, POINTS @ yaw_to_rotmat(yaw).T), yaw_to_rotmat(yaw), atol=1e-9)
    assert yaw_alignment(POINTS, POINTS @ rotvec_to_rotmat([0.4, 0.0, 0.0]).T)[2, 2] == 1.0
