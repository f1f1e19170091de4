"""Sizes of a video's pictures: delivered and stored."""

import numpy as np
import pytest

from humanmm.models.records.video import PictureSizes, VideoFacts
from humanmm.storage.store.codec import decode, encode

FACTS = VideoFacts(
    1024, 576, np.arange(3) / 25, np.ones(3, bool), 0, "dvvideo", "avi", coded_size=(720, 576),
    sample_aspect_ratio=(64, 45), first_field="bottom",
)  # fmt: skip


def test_stored_pictures_are_turned_upright() -> None:
    turned = VideoFacts(576, 1024, FACTS.time_s, FACTS.keyframe, 90, "h264", "mp4", coded_size=(720, 576))
    assert FACTS.sizes == PictureSizes((1024, 576), (720, 576))
    assert turned.sizes == PictureSizes((576, 1024), (576, 720))
    known_by_size_alone = VideoFacts(640, 360, FACTS.time_s, FACTS.keyframe, 90, "h264", "mp4")
    assert known_by_size_alone.sizes == PictureSizes((640, 360), (640, 360))


def test_points_and_cameras_move_together() -> None:
    sizes = FACTS.sizes
    K = np.array([[[700.0, 0, 360], [0, 995.5, 288], [0, 0, 1]]])
    square = sizes.squared(K, sizes.coded)[0]
    point = np.array([0.3, -0.2, 2.0])
    pixel, moved = ((matrix @ point)[:2] / point[2] for matrix in (K[0], square))
    assert moved == pytest.approx(pixel * sizes.to_square)
    assert square[0, 0] == pytest.approx(square[1, 1], rel=1e-3) and square[:2, 2] == pytest.approx((512, 288))


def test_a_proportion_tells_which_pixels_a_picture_has() -> None:
    sizes = FACTS.sizes
    assert sizes.like(512, 288, within=0.01) == sizes.square
    assert sizes.like(360, 288, within=0.01) == sizes.coded
    assert sizes.like(640, 480, within=0.01) is None


def test_the_store_keeps_them() -> None:
    again = decode(encode(FACTS, VideoFacts), VideoFacts)
    assert again.sizes == FACTS.sizes and again.sample_aspect_ratio == (64, 45)
    assert (again.first_field, again.interlaced) == ("bottom", True)
