"""MoveNet's decoding: parts of pictures, and the region that follows from keypoints."""

import numpy as np
import pytest

from humanmm.models.perception.movenet import REACH, detect, region_of
from humanmm.models.perception.picture import Picture, whole
from humanmm.models.perception.regions import Region


def test_a_part_of_a_picture_gives_the_same_keypoints_as_the_whole(clip_picture: Picture) -> None:
    (found,) = detect(clip_picture, whole(clip_picture))
    assert found.keypoints is not None
    height = float(np.ptp(found.keypoints[:, 1]))
    part = Region(found.region.x + 0.1 * height, found.region.y - 0.05 * height, 2.2 * height)
    again = [person.keypoints for person in detect(clip_picture, part) if person.keypoints is not None]
    assert min(np.median(np.linalg.norm((found.keypoints - one)[:, :2], axis=1)) for one in again) < 0.02 * height


def test_a_region_lies_upright_along_the_trunk_and_holds_the_whole_body() -> None:
    points = np.ones((17, 3))
    points[:, :2] = [100.0, 50.0]
    points[[5, 6], :2] = [[150.0, 45.0], [150.0, 55.0]]  # he lies with his head to the right
    points[[15, 16], :2] = [[20.0, 45.0], [20.0, 55.0]]
    region = region_of(points)
    assert region is not None and (region.x, region.y) == (100.0, 50.0)
    assert region.angle == pytest.approx(np.pi / 2)
    assert region.side == pytest.approx(REACH * np.hypot(80, 5))
    points[3:, 2] = 0.0
    assert region_of(points) is None
