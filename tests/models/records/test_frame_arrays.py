"""Records of frames are cut and put together."""

import numpy as np
import pytest

from humanmm.models.records.frame_arrays import FrameArrays
from humanmm.models.records.hands import HandTracks
from humanmm.models.records.tracks import PoseEstimates

RNG = np.random.default_rng(0)
HANDS = HandTracks(
    RNG.random((4, 2), np.float32), RNG.random((4, 2, 21, 2), np.float32), RNG.random((4, 2, 21, 3), np.float32)
)
POSE = PoseEstimates(RNG.random((4, 20, 3), np.float32), RNG.random((4, 20), np.float32), RNG.random(4, np.float32))


@pytest.mark.parametrize("whole", [HANDS, POSE])
def test_parts_put_together_are_the_whole(whole: FrameArrays) -> None:
    together = whole.chosen(slice(0, 1)).then(whole.chosen(np.array([1, 2, 3])))
    assert type(together) is type(whole)
    for one, other in zip(vars(together).values(), vars(whole).values(), strict=True):
        np.testing.assert_array_equal(one, other)
