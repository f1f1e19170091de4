"""Networks as torch modules compute what LiteRT computes."""

import numpy as np
import pytest

from humanmm.models.perception.runtime import networks
from humanmm.models.perception.runtime.device import DeviceNetwork
from humanmm.models.perception.runtime.graph import Graph
from humanmm.models.perception.runtime.litert import InterpreterPool
from humanmm.models.weights.shipped import read_weights

OF_CROPS = (
    "hand_landmark_lite.tflite", "movenet-thunder.tflite", "pose_landmark_full.tflite", "pose_landmark_heavy.tflite",
)  # fmt: skip


@pytest.mark.parametrize("name", OF_CROPS)
def test_outputs_are_those_of_litert(name: str) -> None:
    model = read_weights(name)
    processor, device = InterpreterPool(model, 1), DeviceNetwork(model, "cpu")
    picture = processor.sample_input()
    for one, other in zip(device.run(picture), processor.run(picture), strict=True):
        assert (one.shape, one.dtype) == (other.shape, other.dtype)
        np.testing.assert_allclose(one, other, atol=networks.TOLERANCE / 2 * np.abs(other).max())


def test_only_the_outputs_that_are_wanted_come_back_in_their_order() -> None:
    model = read_weights("hand_landmark_lite.tflite")
    device = DeviceNetwork(model, "cpu")
    picture = InterpreterPool(model, 1).sample_input()
    world, points = device.run(picture, ("Identity_3", "Identity"))
    everything = device.run(picture)
    np.testing.assert_array_equal(points, everything[0])
    np.testing.assert_array_equal(world, everything[3])


def test_a_network_with_an_operation_that_is_not_there_is_refused_by_its_name() -> None:
    with pytest.raises(ValueError, match=r"the operation \w+, which this module does not know"):
        Graph(read_weights("movenet-multipose.tflite"))
