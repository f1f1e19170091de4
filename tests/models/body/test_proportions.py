"""A body's proportions from the bones that are seen."""

import numpy as np
import pytest

from humanmm.models.body.body24 import load_body
from humanmm.models.body.landmarks import load_landmarks
from humanmm.models.body.proportions import bone_lengths, in_detector_convention, resized, shape_from_bones
from humanmm.models.records.landmarks import INDEX, NUM_LANDMARKS


def standing() -> np.ndarray:
    """A body that stands, landmarks in metres (x right, y down, z away)."""
    pose = np.zeros((NUM_LANDMARKS, 3))
    for joint, height, width in (("shoulder", -0.5, 0.17), ("elbow", -0.24, 0.22), ("wrist", 0.0, 0.25),
                                 ("hip", 0.0, 0.11), ("knee", 0.4, 0.12), ("ankle", 0.78, 0.12)):  # fmt: skip
        for side, sign in (("left", 1), ("right", -1)):
            pose[INDEX[f"{side}_{joint}"]] = [sign * width, height, 0.02]
    return pose


def test_longer_bones_give_a_shape_with_longer_bones_but_less_than_measured() -> None:
    body = load_body()
    usual = bone_lengths(standing()[None])
    lengths = [body.rest_joints(shape_from_bones(usual * scale, body)) for scale in (1.0, 1.15)]
    height = [float(joints[:, 1].max() - joints[:, 1].min()) for joints in lengths]
    assert 1.03 < height[1] / height[0] < 1.15


def test_lifted_landmarks_give_the_shape_of_the_body_that_they_lie_on() -> None:
    body, model = load_body(), load_landmarks()
    usual = np.zeros(body.num_betas)
    bones = bone_lengths((body.rest_joints(usual)[model.joint] + model.offsets(usual))[None])
    assert np.abs(shape_from_bones(in_detector_convention(bones, lifted=True), body)).max() < 1e-3
    taken_for_a_detectors = shape_from_bones(in_detector_convention(bones, lifted=False), body)
    assert body.standing_height(taken_for_a_detectors) > 1.02 * body.standing_height(usual)


@pytest.mark.parametrize("height_m", [1.05, 1.60, 1.82, 2.05])
def test_a_known_height_is_that_of_the_shape_and_bones_tell_its_proportions(height_m: float) -> None:
    body = load_body()
    bones = bone_lengths(np.repeat(standing()[None], 5, axis=0))
    betas = shape_from_bones(bones, body, height_m=height_m)
    assert body.standing_height(betas) == pytest.approx(height_m, abs=0.001)

    def legs(betas: np.ndarray) -> float:
        return float(np.linalg.norm(np.diff(body.rest_joints(betas)[[1, 4, 7]], axis=0), axis=1).sum()) / height_m

    size = np.zeros(body.num_betas)
    size[0] = (height_m - body.standing_height(size)) / (
        body.standing_height(np.eye(10)[0]) - body.standing_height(size)
    )
    assert legs(betas) == pytest.approx(legs(size), abs=0.01), "no part of the body takes the difference alone"


def test_a_resized_body_has_all_joints_as_many_times_as_far_apart() -> None:
    body = load_body()
    betas = np.random.default_rng(2).normal(0, 0.5, body.num_betas)
    for factor in (0.9, 1.0, 1.1):
        wanted = factor * body.rest_joints(betas)
        assert np.abs(body.rest_joints(resized(betas, body, factor)) - wanted).max() < 0.015
