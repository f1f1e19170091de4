"""Refined keypoints of a real picture: near those of the networks, alike in the mirror."""

import numpy as np
import pytest

from humanmm.models.perception.blazepose import crop_of
from humanmm.models.perception.keypoints.fusion import joined_of, located_in
from humanmm.models.perception.keypoints.surroundings import REFINED
from humanmm.models.perception.movenet import detect
from humanmm.models.perception.picture import Picture, whole
from humanmm.models.perception.regions import Region

ROWS = np.array(REFINED)


@pytest.fixture
def region(clip_picture: Picture) -> Region:
    return detect(clip_picture, whole(clip_picture))[0].region


def test_limbs_move_by_a_hundredth_of_the_crop_and_the_face_stays(clip_picture: Picture, region: Region) -> None:
    crop = crop_of(clip_picture, region, mirrored=False)
    (joined, _), refined = joined_of(crop, region), located_in(crop, region)
    moved = np.linalg.norm(refined.keypoints - joined.keypoints, axis=1) / region.side
    assert 0.001 < np.median(moved[ROWS]) < 0.02 and moved[ROWS].max() < 0.1
    others = np.delete(np.arange(33), ROWS)
    np.testing.assert_array_equal(refined.keypoints[others], joined.keypoints[others])
    foretold, before = np.array(refined.keypoint_sigma), np.array(joined.keypoint_sigma)
    np.testing.assert_array_equal(foretold[others], before[others])
    assert 0.5 < np.median(foretold[ROWS] / before[ROWS]) < 2.0 and (foretold[ROWS] != before[ROWS]).all()


def test_the_mirrored_crop_gives_nearly_the_same(clip_picture: Picture, region: Region) -> None:
    plain, mirrored = (
        located_in(crop_of(clip_picture, region, mirrored=side), region, mirrored=side) for side in (False, True)
    )
    apart = np.linalg.norm(plain.keypoints - mirrored.keypoints, axis=1)[ROWS] / region.side
    assert np.median(apart) < 0.015
