"""The shipped refiner reads one look."""

import numpy as np

from humanmm.models.perception.blazepose import crop_of
from humanmm.models.perception.keypoints.fusion import joined_of
from humanmm.models.perception.keypoints.reading import load_refiner, refined
from humanmm.models.perception.keypoints.refine import seen_in_crop
from humanmm.models.perception.keypoints.surroundings import COUNT
from humanmm.models.perception.movenet import detect
from humanmm.models.perception.picture import Picture, whole


def test_shifts_are_small_and_depend_on_what_is_seen(clip_picture: Picture) -> None:
    region = detect(clip_picture, whole(clip_picture))[0].region
    crop = crop_of(clip_picture, region, mirrored=False)
    shift, sigma = refined(seen_in_crop(*joined_of(crop, region), mirrored=False))
    assert shift.shape == (COUNT, 2) and 0 < np.abs(shift).max() < 30
    assert sigma.shape == (COUNT,) and sigma.min() > 0.2 and sigma.max() < 30
    covered = crop.copy()
    covered[128:] = 127  # his legs
    without, doubtful = refined(seen_in_crop(*joined_of(covered, region), mirrored=False))
    assert np.abs(without - shift)[6:16].max() > 0.5
    assert np.median((doubtful / sigma)[6:16]) > 1.5, "who is hidden is not where anybody says"


def test_the_network_is_loaded_once() -> None:
    assert load_refiner() is load_refiner() and not load_refiner().training
