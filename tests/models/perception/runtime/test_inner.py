"""Inner tensors as outputs."""

import numpy as np

from humanmm.models.perception.runtime.inner import showing
from humanmm.models.perception.runtime.litert import InterpreterPool
from humanmm.models.perception.runtime.networks import INNER
from humanmm.models.weights.shipped import read_weights

HEAVY = "pose_landmark_heavy.tflite"


def test_a_network_shows_its_inner_tensors_and_says_what_it_said() -> None:
    model = read_weights(HEAVY)
    plain, shown = InterpreterPool(model, 1), InterpreterPool(showing(model, INNER[HEAVY]), 1)
    picture = plain.sample_input()
    names = ("Identity", "Identity_3")
    points, heat, fine, coarse = shown.run(picture, (*names, "fine", "coarse"))
    assert fine.shape == (1, 64, 64, 48) and coarse.shape == (1, 32, 32, 96)
    for one, other in zip((points, heat), plain.run(picture, names), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-4 * np.abs(other).max())


def test_without_tensors_the_file_stays_as_it_is() -> None:
    assert showing(b"any", {}) == b"any"
