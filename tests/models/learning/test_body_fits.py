"""Fits of rendered windows: near the truth where the networks see well, nothing where they do not."""

import numpy as np
from pair_windows import pair_arrays

from humanmm.models.body.body24 import FREE_JOINTS
from humanmm.models.geometry.rotations import rotation_angle
from humanmm.models.learning.body_fits import fit_window, rotations_of_windows
from humanmm.models.perception.lifting.lifted import keep


def window(number: int) -> dict[str, np.ndarray]:
    return {name: values[number] for name, values in pair_arrays().items()}


def test_a_window_is_fitted_near_the_truth_with_its_true_camera() -> None:
    given = window(0)
    found = fit_window(given, keep)
    assert found.fitted.all() and found.observed.all() and found.confidence_fitted.min() > 0.3
    error = rotation_angle(np.swapaxes(given["R_cam_root"], -1, -2) @ found.R_cam_root_fitted)
    assert np.degrees(np.median(error)) < 25  # eight frames of noise, limbs anyhow
    gap = np.linalg.norm(found.pelvis_cam_fitted - given["joints_cam"][:, 0], axis=-1)
    assert np.median(gap) < 0.4
    assert found.packed()["body_pose_fitted"].dtype == np.float32


def test_who_is_hardly_seen_is_not_fitted() -> None:
    given = window(0) | {"confidence": np.zeros(len(pair_arrays()["time_s"][0]), np.float32)}
    found = fit_window(given, keep)
    assert not found.fitted.any() and not found.observed.any()


def test_rotations_are_those_of_root_and_free_joints() -> None:
    given = window(1)
    R = rotations_of_windows(given["R_world_cam"], given["R_cam_root"], given["body_pose"])
    assert R.shape == (len(given["time_s"]), 1 + len(FREE_JOINTS), 3, 3)
    np.testing.assert_allclose(R[:, 0], given["R_world_cam"] @ given["R_cam_root"], atol=1e-6)
    np.testing.assert_allclose(np.linalg.det(R), 1, atol=1e-5)
