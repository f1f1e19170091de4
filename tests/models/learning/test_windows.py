"""Windows: inputs and truth agree, whatever is done to both."""

from dataclasses import fields

import numpy as np
import torch
from pair_windows import pair_arrays

from humanmm.models.learning.windows import (
    Variation,
    Windows,
    _mirrored,
    _rolled,
    systematic_errors,
    varied,
    windows_of,
)
from humanmm.models.records.landmarks import COCO_LANDMARKS

PLAIN = Variation(0.0, (0.0, 0.0), (0.0, 0.0), 0.0, 0.0, 0.0, 0.0, 0.0)


def test_truth_is_named_as_the_input_and_swaps_are_known() -> None:
    windows, errors = windows_of(pair_arrays())
    assert windows.swapped.float().mean(dim=1).tolist() == [0, 0, 0, 1] and windows.clear.all()
    assert (windows.landmarks - windows.truth).norm(dim=-1).max() < 0.25
    assert errors.landmarks.std() < 0.06 and errors.points.abs().max() < 0.05


def test_legs_that_are_seen_too_flat_are_a_systematic_error() -> None:
    rng = np.random.default_rng(0)
    truth = rng.normal(0, 0.3, (3000, 33, 3))
    flat = truth * [0.0, 0.0, -0.4]
    S = systematic_errors(truth, flat + rng.normal(0, 0.1, truth.shape))
    other = rng.normal(0, 0.3, (50, 33, 3))
    foretold = (other.reshape(50, -1) @ S).reshape(other.shape)
    assert np.abs(foretold - other * [0.0, 0.0, -0.4]).std() < 0.02


def test_errors_are_systematic_ones_and_the_rest() -> None:
    windows, errors = windows_of(pair_arrays())
    systematic = (windows.truth.flatten(-2) @ errors.systematic).reshape(windows.truth.shape)
    assert torch.allclose(windows.truth + systematic + errors.landmarks, windows.landmarks, atol=1e-5)


def test_the_root_rotates_the_body_that_the_landmarks_show() -> None:
    """The body's left is where its left hip is."""
    windows, _ = windows_of(pair_arrays())
    left = windows.truth[:3, :, 23] - windows.truth[:3, :, 24]
    left = left / left.norm(dim=-1, keepdim=True)
    assert ((windows.pose[:3, :, 0, :, 0] * left).sum(dim=-1) > 0.95).all()


def test_a_part_of_windows_has_frames_at_equal_steps() -> None:
    windows, _ = windows_of(pair_arrays())
    n = windows.time_s.shape[1]
    seen = set()
    for seed in range(20):
        part = windows.part(3, np.random.default_rng(seed))
        steps = part.time_s.diff(dim=1)
        assert part.truth.shape == (len(windows), 3, 33, 3) and torch.allclose(steps[:, :1], steps[:, 1:])
        at = (windows.time_s[0] == part.time_s[0, 0]).nonzero().item()
        assert torch.equal(windows.points[:, at], part.points[:, 0])
        seen.add((at, round(float(steps[0, 0]), 4)))
    assert len(seen) > 5
    assert windows.part(n + 5, np.random.default_rng(0)).time_s.shape[1] == n


def test_a_mirror_image_of_a_mirror_image_is_the_window() -> None:
    windows, _ = windows_of(pair_arrays())
    everything = torch.ones(len(windows), dtype=torch.bool)
    twice = _mirrored(_mirrored(windows, everything), everything)
    for field in fields(Windows):
        assert torch.allclose(getattr(twice, field.name).float(), getattr(windows, field.name).float(), atol=1e-6)


def test_a_window_that_is_rolled_or_mirrored_stays_one_body() -> None:
    windows, _ = windows_of(pair_arrays())
    for changed in (
        _rolled(windows, torch.full((len(windows),), 0.7)), _mirrored(windows, torch.ones(len(windows)) > 0)
    ):  # fmt: skip
        left = changed.truth[:3, :, 23] - changed.truth[:3, :, 24]
        left = left / left.norm(dim=-1, keepdim=True)
        assert ((changed.pose[:3, :, 0, :, 0] * left).sum(dim=-1) > 0.95).all()
        # a keypoint lies where its landmark is: both scaled to the same size
        flat = changed.truth[..., :2] / changed.truth[..., :2].std()
        assert (changed.points / changed.points.std() - flat).norm(dim=-1).median() < 0.35


def test_nothing_is_changed_but_sides_without_variation() -> None:
    windows, _ = windows_of(pair_arrays())
    changed, given = varied(windows, PLAIN, torch.Generator().manual_seed(0))
    assert torch.allclose(changed.truth.norm(dim=-1).sort().values, windows.truth.norm(dim=-1).sort().values, atol=1e-5)
    assert given.has_landmarks.equal(given.exists)


def test_coco_windows_have_its_keypoints_and_no_landmarks() -> None:
    windows, _ = windows_of(pair_arrays())
    _, given = varied(windows, Variation(coco=1.0, hidden=0.0), torch.Generator().manual_seed(0))
    assert not given.has_landmarks.any()
    others = np.setdiff1d(np.arange(33), COCO_LANDMARKS)
    assert (given.certainty[..., others] == 0).all()
    known = set(windows.certainty.unique().tolist())
    assert set() < set(given.certainty[..., list(COCO_LANDMARKS)].unique().tolist()) - {0.0} <= known
