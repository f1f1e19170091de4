"""Tracks of hands: rows, sides, pixels."""

import numpy as np

from humanmm.models.records.hands import HandTracks, not_looked


def hands(count: int = 4) -> HandTracks:
    rng = np.random.default_rng(0)
    return HandTracks(
        rng.random((count, 2), np.float32),
        rng.random((count, 2, 21, 2), np.float32),
        rng.random((count, 2, 21, 3), np.float32),
    )


def test_sides_are_exchanged_in_the_marked_frames_alone_and_twice_is_nothing() -> None:
    swapped = np.array([True, False, False, True])
    before, after = hands(), hands().with_sides_swapped(swapped)
    for one, other, again in zip(
        *(vars(h).values() for h in (before, after, after.with_sides_swapped(swapped))), strict=True
    ):
        np.testing.assert_array_equal(other[swapped], one[swapped][:, ::-1])
        np.testing.assert_array_equal(other[~swapped], one[~swapped])
        np.testing.assert_array_equal(again, one)


def test_only_pixels_are_scaled() -> None:
    larger = hands().scaled(np.array([2.0, 3.0]))
    np.testing.assert_allclose(larger.points, hands().points * [2, 3])
    np.testing.assert_array_equal(larger.points3d, hands().points3d)
    assert larger.points.dtype == np.float32


def test_who_was_not_looked_at_has_no_confidence_at_all() -> None:
    assert np.isnan(not_looked(3).confidence).all()
