"""What the refiner is shown: windows about landmarks, between the cells of the networks' layers."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.perception import blazepose, movenet
from humanmm.models.perception.keypoints.surroundings import CHANNELS, COUNT, HANDS, LIMB_ROWS, REFINED, WINDOW, Seen
from humanmm.models.records.landmarks import INDEX, LIMBS, SWAP

MIDDLE = WINDOW // 2


@pytest.fixture
def seen() -> Seen:
    """Layers whose first channel is the column and whose second is the row, in pixels of the crop."""
    at = 4.0 * np.arange(64) + 2.0
    fine = np.zeros((64, 64, 48), np.float32)
    fine[..., 0], fine[..., 1] = at, at[:, None]
    rng = np.random.default_rng(0)
    fused = rng.uniform(40, 200, (COUNT, 2))
    return Seen(
        blazepose=fused + 1.0, thunder=fused - 1.0, fused=fused, visibility=np.full(COUNT, 0.9),
        sigma=np.full(COUNT, 0.01), score=np.full(COUNT, 0.8), is_crossed=np.zeros(COUNT, bool),
        blazepose_inside=blazepose.Inside(
            fine, rng.random((32, 32, 96)).astype(np.float32), np.full((64, 64, 39), -9.0, np.float32)
        ),
        thunder_inside=movenet.Inside(np.zeros((64, 64, 24), np.float32), np.full((64, 64, 17), -9.0, np.float32)),
    )  # fmt: skip


def test_limbs_feet_and_hands_are_refined_each_with_its_counterpart() -> None:
    assert REFINED[: len(LIMB_ROWS)] == LIMBS
    assert {REFINED[row] for row in HANDS} == set(range(INDEX["left_pinky"], INDEX["right_thumb"] + 1))
    assert {int(SWAP[k]) for k in REFINED} == set(REFINED)


def test_a_window_has_the_landmark_in_its_middle_and_a_cell_from_place_to_place(seen: Seen) -> None:
    windows = seen.windows()
    assert windows.shape == (COUNT, WINDOW, WINDOW, CHANNELS)
    np.testing.assert_allclose(windows[:, MIDDLE, MIDDLE, :2], seen.fused, atol=1e-3)
    np.testing.assert_allclose(windows[:, MIDDLE, -1, 0] - seen.fused[:, 0], 12.0, atol=1e-3)
    np.testing.assert_allclose(windows[:, 0, MIDDLE, 1] - seen.fused[:, 1], -12.0, atol=1e-3)


def test_beyond_the_crop_there_is_nothing(seen: Seen) -> None:
    outside = replace(seen, fused=np.tile([300.0, -50.0], (COUNT, 1)))
    assert not outside.windows().any()
    np.testing.assert_array_equal(outside.coarse(), np.tile(seen.blazepose_inside.coarse[0, 31], (COUNT, 1)))


def test_a_landmark_sees_its_own_heat_in_thunders_map_by_blazeposes_names(seen: Seen) -> None:
    left, right = (REFINED.index(INDEX[f"{side}_knee"]) for side in ("left", "right"))
    seen.thunder_inside.heat_logits[..., 13] = 9.0  # COCO's left knee
    assert seen.windows()[left, MIDDLE, MIDDLE, -1] > 0.99 and seen.windows()[right, MIDDLE, MIDDLE, -1] < 0.01
    crossed = replace(seen, is_crossed=np.isin(np.arange(COUNT), [left, right])).windows()
    assert crossed[left, MIDDLE, MIDDLE, -1] < 0.01 and crossed[right, MIDDLE, MIDDLE, -1] > 0.99
    assert not crossed[HANDS.start, ..., -1].any(), "Thunder knows no hands"


def test_numbers_say_where_the_networks_differ(seen: Seen) -> None:
    numbers = seen.numbers()
    assert numbers.shape == (COUNT, 13) and numbers.dtype == np.float32
    np.testing.assert_allclose(numbers[:, :4], np.tile([0.125, 0.125, -0.125, -0.125], (COUNT, 1)), atol=1e-6)
    np.testing.assert_allclose(numbers[:, 8], 0.9)
