"""The three trainings, each on what the one before gives."""

import numpy as np
import torch
from motion_clips_of_pairs import source

from humanmm.models.learning.training.motion import (
    MotionRecipe,
    corrected,
    ms_hmr_training,
    predictor_training,
    refiner_training,
)
from humanmm.models.motion.networks.ms_hmr import MsHmr
from humanmm.models.motion.networks.trajectory import TrajectoryPredictor

RECIPE = MotionRecipe(steps=2, batch=2, warm_up=1)


def test_each_training_moves_its_own_network_alone() -> None:
    torch.manual_seed(0)
    ms_hmr, predictor = MsHmr(), TrajectoryPredictor()
    before = {name: value.clone() for name, value in predictor.state_dict().items()}
    trainings = (
        ms_hmr_training(RECIPE, source(varied=True)),
        predictor_training(RECIPE, source(), ms_hmr),
        refiner_training(RECIPE, source(), predictor),
    )
    for training in trainings:
        first = {name: value.clone() for name, value in training.network.state_dict().items()}
        training.run(2, lambda _, __: None)
        assert training.step == 2
        assert any(not torch.equal(value, first[name]) for name, value in training.network.state_dict().items())
    assert all(torch.equal(value, before[name]) for name, value in predictor.state_dict().items())


def test_without_ms_hmr_poses_are_as_they_were_fitted() -> None:
    clips = source().draw(2, np.random.default_rng(0))
    assert corrected(clips, None) is clips
    torch.testing.assert_close(corrected(clips, MsHmr()).given.rotations, clips.given.rotations)
