"""Fits of rendered windows: near the truth where the networks see well, nothing where they do not."""

import numpy as np
from pair_windows import pair_arrays

from humanmm.models.geometry.rotations import rotation_angle
from humanmm.models.learning.body_fits import fit_window
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
