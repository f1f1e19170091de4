"""Every shipped detector and pose network on one real frame, against a detector that is none of them."""

import numpy as np
import pytest

from humanmm import parts
from humanmm.models.perception.picture import Picture, whole
from humanmm.models.perception.regions import HEIGHT_OF_SIDE
from humanmm.models.records import landmarks

LIMBS = list(landmarks.LIMBS)


@pytest.mark.parametrize("name", parts.BUILT_IN["people.detector"])
def test_a_detector_finds_the_person_and_nobody_else(
    name: str, clip_picture: Picture, openpose_limbs: np.ndarray
) -> None:
    (found,) = parts.load("people.detector", name)(clip_picture, whole(clip_picture))
    hips, height = openpose_limbs[6:8, :2].mean(axis=0), np.ptp(openpose_limbs[:, 1])
    assert np.hypot(found.region.x - hips[0], found.region.y - hips[1]) < 0.1 * height
    assert 0.9 * height < found.region.side < 3 * height
    assert found.box[1] < openpose_limbs[:2, 1].min() and (found.box[2:] > found.box[:2]).all()


@pytest.mark.parametrize("name", parts.BUILT_IN["people.pose"])
def test_a_pose_network_finds_the_limbs_and_their_names_also_in_a_mirror(
    name: str, clip_picture: Picture, openpose_limbs: np.ndarray
) -> None:
    locate = parts.load("people.pose", name)
    detect = parts.load("people.detector", "movenet-multipose")
    region = detect(clip_picture, whole(clip_picture))[0].region
    for _ in range(2):
        region = locate(clip_picture, region).next_region
    plain, mirrored = (locate(clip_picture, region, mirrored=side) for side in (False, True))
    height = HEIGHT_OF_SIDE * region.side
    seen = openpose_limbs[:, 2] > 0.5
    error = np.linalg.norm(plain.keypoints[LIMBS, :2] - openpose_limbs[:, :2], axis=1)[seen]
    assert seen.sum() > 8 and np.median(error) < 0.04 * height
    apart = np.linalg.norm(plain.keypoints[LIMBS, :2] - mirrored.keypoints[LIMBS, :2], axis=1)
    assert np.median(apart) < 0.04 * height
    assert plain.presence > 0.9 and plain.mask.max() > 200
