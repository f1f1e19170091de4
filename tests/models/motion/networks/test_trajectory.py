"""Trajectory predictor and refiner before any training."""

from dataclasses import replace

import torch
from motion_sequences import sequence

from humanmm.models.motion.networks.trajectory import TrajectoryPredictor, TrajectoryRefiner


def test_the_predictor_reads_the_limbs_and_not_the_path() -> None:
    torch.manual_seed(0)
    predictor, motion = TrajectoryPredictor(width=8).eval(), sequence()
    found = predictor(motion)
    assert found.contacts.shape[-1] == 4 and found.velocity.shape == found.log_sigma.shape == motion.pelvis.shape
    drifting = replace(motion, pelvis=motion.pelvis + torch.linspace(0, 2, 40)[None, :, None])
    torch.testing.assert_close(predictor(drifting).velocity, found.velocity, atol=1e-4, rtol=1e-3)


def test_at_first_the_refiner_leaves_the_prediction_as_it_is() -> None:
    torch.manual_seed(0)
    motion = sequence()
    predicted = TrajectoryPredictor(width=8).eval()(motion)
    refined = TrajectoryRefiner(width=8).eval()(motion, predicted)
    torch.testing.assert_close(refined.velocity, predicted.velocity)
    torch.testing.assert_close(refined.contacts, predicted.contacts)
    assert refined.turn.abs().max() == 0
