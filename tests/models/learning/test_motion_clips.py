"""Clips: what is given differs from what is true by the errors alone."""

import numpy as np
import torch
from motion_clips_of_pairs import fitted_arrays, source

from humanmm.models.learning.motion_clips import (
    FRAMES,
    SHORTEST,
    ClipSource,
    error_windows,
    mirrored,
    motion_takes,
)
from humanmm.models.motion.networks.sequence import joints_of


def test_a_window_without_a_wrong_fit_has_the_errors_of_its_fit() -> None:
    windows = error_windows(fitted_arrays())
    assert len(windows) == 3  # in the fourth left and right are swapped
    arrays = fitted_arrays()
    seconds = float(arrays["time_s"][0, -1])
    assert len(windows[0].pelvis) == int(seconds * 30 + 1e-3) + 1
    np.testing.assert_allclose(np.linalg.norm(windows[0].shifted, axis=1), 0.1, atol=1e-5)


def test_the_seed_decides_and_clips_have_one_shot_or_more() -> None:
    a, b = (source().draw(6, np.random.default_rng(1)) for _ in range(2))
    assert torch.equal(a.given.rotations, b.given.rotations) and torch.equal(a.given.shot, b.given.shot)
    assert a.given.rotations.shape == (6, FRAMES, 20, 3, 3)
    for shot in a.given.shot.tolist():
        lengths = [shot.count(k) for k in sorted(set(shot))]
        assert 1 <= len(lengths) <= 4 and min(lengths) >= SHORTEST


def test_rotations_stay_rotations_and_both_share_their_cameras() -> None:
    clips = source().draw(8, np.random.default_rng(2))
    for motion in (clips.given, clips.true):
        R = motion.rotations
        torch.testing.assert_close(R @ R.transpose(-1, -2), torch.eye(3).expand_as(R), atol=1e-4, rtol=0)
    gap = (clips.given.pelvis - clips.true.pelvis).norm(dim=-1)
    torch.testing.assert_close(gap, torch.full_like(gap, 0.1), atol=1e-3, rtol=0)


def test_a_mirror_image_twice_is_the_clip_and_once_is_another_body_that_moves_alike() -> None:
    clips = source().draw(4, np.random.default_rng(3))
    everything = torch.ones(4, dtype=torch.bool)
    once = mirrored(clips, everything)
    twice = mirrored(once, everything)
    torch.testing.assert_close(twice.given.rotations, clips.given.rotations)
    torch.testing.assert_close(twice.contacts, clips.contacts)
    left, right = 7, 8
    mirror = torch.tensor([-1.0, 1.0, 1.0])
    torch.testing.assert_close(
        joints_of(once.true)[:, :, left], joints_of(clips.true)[:, :, right] * mirror, atol=1e-4, rtol=1e-4
    )


def test_takes_are_sequences_and_routines() -> None:
    takes = motion_takes([], np.random.default_rng(0), routines=2)
    assert len(takes) == 2 and takes[0].rotations.shape[1:] == (20, 3, 3)
    assert 0 < takes[0].contacts.mean() < 1
    assert "0 minutes" in ClipSource(takes, error_windows(fitted_arrays()), whole=0.5).summary
