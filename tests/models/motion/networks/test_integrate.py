"""The networks on a motion at any rate and of any length."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from motion_sequences import aligned

from humanmm.models.motion.networks import integrate as module
from humanmm.models.motion.networks.integrate import integrate, nearest_rows, trajectory
from humanmm.models.motion.networks.ms_hmr import MsHmr
from humanmm.models.motion.networks.trajectory import TrajectoryPredictor, TrajectoryRefiner


def networks() -> tuple[TrajectoryPredictor, TrajectoryRefiner]:
    torch.manual_seed(0)
    return TrajectoryPredictor(width=8).eval(), TrajectoryRefiner(width=8).eval()


def test_a_higher_rate_gives_the_same_velocities() -> None:
    slow, fast = (integrate(aligned(round(2 * fps), fps), *networks()) for fps in (30.0, 60.0))
    np.testing.assert_allclose(fast.velocity[8:-8:2], slow.velocity[4:-4], atol=0.01)
    assert fast.rotations is None


def test_a_long_motion_is_read_in_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = integrate(aligned(200), *networks())
    monkeypatch.setattr(module, "CHUNK", 60)
    monkeypatch.setattr(module, "BEYOND", 40)
    pieces = integrate(aligned(200), *networks())
    np.testing.assert_allclose(pieces.velocity, whole.velocity, atol=2e-3)


def test_an_untrained_ms_hmr_leaves_rotations_as_they_are() -> None:
    motion = aligned(50, 24.0)
    found = integrate(motion, *networks(), MsHmr(width=20, depth=1, heads=2).eval())
    assert found.rotations is not None
    np.testing.assert_allclose(found.rotations, motion.rotations, atol=1e-5)


def test_two_frames_are_enough() -> None:
    assert integrate(aligned(2), *networks()).velocity.shape == (2, 3)


def test_the_shipped_networks_see_that_somebody_stands_still() -> None:
    motion = aligned(60)
    rotations, pelvis = (np.repeat(values[:1], 60, axis=0) for values in (motion.rotations, motion.pelvis))
    still = replace(motion, rotations=rotations, pelvis=pelvis)
    found = trajectory(still)
    assert np.median(np.linalg.norm(found.velocity, axis=1)) < 0.05 < np.median(found.velocity_sigma) * 5


def test_the_nearest_frame_is_found_for_every_moment() -> None:
    assert nearest_rows(np.array([0.0, 0.04, 0.06, 9.0]), np.array([0.0, 0.1, 0.2])).tolist() == [0, 0, 1, 2]
    assert nearest_rows(np.array([0.0, 1.0]), np.array([0.5])).tolist() == [0, 0]
