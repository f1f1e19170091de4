"""Trajectory predictor and trajectory refiner (paper section 3.4), after WHAM (Shin et al. 2024).

The predictor reads how a body moves its limbs, and says which feet stand and how fast the pelvis goes in its own axes:
no camera has a part in it. The refiner weighs that against the path that the cameras show, and says what is left of
either, with the error that it expects.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from humanmm.models.motion.networks.sequence import PATH_FEATURES, POSE_FEATURES, MotionSequence


@dataclass(frozen=True)
class Trajectory:
    """Of every frame."""

    contacts: Tensor
    """(B,n,4): log-odds that `CONTACT_JOINTS` stand."""
    velocity: Tensor
    """(B,n,3): of the pelvis from this frame to the next, in the root's axes, m/s."""
    log_sigma: Tensor
    """(B,n,3): logarithm of its expected error, m/s."""


@dataclass(frozen=True)
class RefinedTrajectory(Trajectory):
    """Of every frame, after the cameras had their say."""

    turn: Tensor
    """(B,n,3): Δ root, a rotation vector in the root's axes: R ← R exp(turn)."""


class TrajectoryPredictor(nn.Module):
    """A bi-directional LSTM over [φ, Γ against gravity] → contacts and velocity of the root."""

    def __init__(self, width: int = 128, layers: int = 2) -> None:
        super().__init__()
        self.inward = nn.Linear(POSE_FEATURES, width)
        self.lstm = nn.LSTM(width, width, layers, batch_first=True, bidirectional=True, dropout=0.1)
        self.outward = nn.Linear(2 * width, 4 + 3 + 3)

    def forward(self, motion: MotionSequence) -> Trajectory:
        """What the limbs say."""
        h, _ = self.lstm(nn.functional.gelu(self.inward(motion.pose_features())))
        contacts, velocity, log_sigma = self.outward(h).split((4, 3, 3), dim=-1)
        return Trajectory(contacts, velocity, log_sigma - 1.5)


class TrajectoryRefiner(nn.Module):
    """A bi-directional LSTM over the prediction and the observed path → contacts, Δ velocity, Δ root."""

    def __init__(self, width: int = 128, layers: int = 1) -> None:
        super().__init__()
        self.inward = nn.Linear(4 + 3 + 3 + POSE_FEATURES + PATH_FEATURES, width)
        self.lstm = nn.LSTM(width, width, layers, batch_first=True, bidirectional=True)
        self.outward = nn.Linear(2 * width, 4 + 3 + 3 + 3)
        nn.init.zeros_(self.outward.weight)
        nn.init.zeros_(self.outward.bias)

    def forward(self, motion: MotionSequence, predicted: Trajectory) -> RefinedTrajectory:
        """The prediction corrected by what was seen."""
        given = [predicted.contacts / 4, predicted.velocity, predicted.log_sigma]
        h = torch.cat([*given, motion.pose_features(), motion.path_features()], dim=-1)
        h, _ = self.lstm(nn.functional.gelu(self.inward(h)))
        contacts, velocity, log_sigma, turn = self.outward(h).split((4, 3, 3, 3), dim=-1)
        return RefinedTrajectory(
            predicted.contacts + contacts, predicted.velocity + velocity, predicted.log_sigma + log_sigma, turn
        )
