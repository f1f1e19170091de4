"""What of the landmark network's output is kept."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.perception.interfaces import Landmarks
from humanmm.models.perception.observation import averaged, inside, observe, on_mask, similarity
from humanmm.models.perception.regions import Region
from humanmm.models.records import landmarks

REGION = Region(200.0, 200.0, 256.0)
SIZE = (400, 400)


def standing() -> Landmarks:
    """A body in the middle of its region, all of it visible and on the mask."""
    keypoints = np.tile([200.0, 130.0, 1.0], (33, 1))
    for joint, height, width in (("shoulder", 150, 20), ("elbow", 180, 28), ("wrist", 205, 30),
                                 ("hip", 210, 12), ("knee", 255, 13), ("ankle", 300, 13)):  # fmt: skip
        for side, sign in (("left", 1), ("right", -1)):
            keypoints[landmarks.INDEX[f"{side}_{joint}"], :2] = 200 + sign * width, height
    mask = np.zeros((128, 128), np.uint8)
    mask[26:118, 44:84] = 255
    return Landmarks(keypoints, np.zeros((33, 3)), 0.95, mask, REGION, REGION)


def test_a_whole_body_is_trusted_and_its_box_holds_the_mask() -> None:
    seen = observe(standing(), SIZE)
    assert seen is not None
    assert seen.confidence == pytest.approx(1.0)
    # the mask's cells are 2 px wide, and pixels of the crop begin at 72
    np.testing.assert_allclose(seen.bbox, [72 + 2 * 44 + 1, 72 + 2 * 26 + 1, 72 + 2 * 84 - 1, 72 + 2 * 118 - 1])


@pytest.mark.parametrize("fault", ["presence", "mask", "shoulders outside", "no trunk"])
def test_what_is_no_body_is_no_observation(fault: str) -> None:
    output = standing()
    if fault == "presence":
        output = replace(output, presence=0.3)
    if fault == "mask":
        output = replace(output, mask=np.roll(output.mask, 60, axis=1))
    if fault == "shoulders outside":
        output.keypoints[[11, 12, 13, 14], 1] -= 300
    if fault == "no trunk":
        output.keypoints[[23, 24], 1] = 152
    assert observe(output, SIZE) is None


def test_an_upper_body_is_an_observation_that_is_trusted_less() -> None:
    output = standing()
    output.keypoints[[25, 26, 27, 28], 1] += 300
    without_legs = observe(output, SIZE)
    output.keypoints[[23, 24], 1] += 300
    without_hips = observe(output, SIZE)
    assert without_legs is not None and without_legs.confidence == pytest.approx(0.4)
    assert without_hips is not None and without_hips.confidence == pytest.approx(0.2)


def test_less_is_enough_of_a_body_that_the_frame_cuts_off() -> None:
    whole, bust = standing(), standing()
    for output in (whole, bust):
        output.keypoints[list(landmarks.WRISTS), 0] += 150  # two of the limbs that are seen are not on the mask
    whole.keypoints[23:29, 2] = 0.0
    bust.keypoints[23:29, 1] += 300
    seen = observe(bust, SIZE)
    assert seen is not None and seen.confidence == pytest.approx(0.2 * (4 / 6) ** 2)
    assert observe(whole, SIZE) is None  # its hips and legs ought to be seen
    bust.keypoints[13:15, 0] += 150
    assert observe(bust, SIZE) is None


def test_similarity_falls_like_a_gaussian_of_the_distance() -> None:
    pose = standing().keypoints
    assert similarity(pose, pose, 256.0) == pytest.approx(1.0)
    moved = pose + np.array([0.06 * 256, 0.0, 0.0])  # one standard deviation
    assert similarity(pose, moved, 256.0) == pytest.approx(np.exp(-0.5))


def test_the_mean_of_two_outputs_lies_between_them() -> None:
    one = standing()
    other = replace(one, keypoints=one.keypoints + 4.0, mask=np.zeros((128, 128), np.uint8))
    mean = averaged(one, other)
    np.testing.assert_allclose(mean.keypoints, one.keypoints + 2.0)
    assert mean.mask.max() == 127


def test_points_in_the_frame_and_on_the_mask() -> None:
    points = np.array([[0.0, 0.0], [400.0, 399.0], [-0.1, 5.0], [5.0, 400.1]])
    np.testing.assert_array_equal(inside(points, SIZE), [True, True, False, False])
    mask = np.zeros((128, 128), np.uint8)
    mask[64, 64] = 1  # the pixel at (201, 201); points within three cells of 2 px count
    found = on_mask(np.array([[201.0, 201.0], [207.0, 201.0], [210.0, 201.0], [900.0, 201.0]]), mask, REGION)
    np.testing.assert_array_equal(found, [True, True, False, False])


def test_limbs_that_another_network_puts_elsewhere_are_less_visible_but_the_person_is_as_much_there() -> None:
    alone = observe(standing(), SIZE)
    doubted = observe(replace(standing(), agreement=np.full(33, 0.4)), SIZE)
    assert alone is not None and doubted is not None
    np.testing.assert_allclose(doubted.keypoints[:, 2], 0.4 * alone.keypoints[:, 2])
    np.testing.assert_array_equal(doubted.bbox, alone.bbox)
    assert doubted.confidence == alone.confidence
