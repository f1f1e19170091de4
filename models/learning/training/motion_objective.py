"""What ms-HMR, trajectory predictor and refiner are trained for, and how good they are."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor, nn

from humanmm.models.learning.motion_clips import MotionClips
from humanmm.models.learning.training.lifter_objective import mean_of_joints, median_and_mean, weighted_mean
from humanmm.models.motion.networks.ms_hmr import MsHmr, PoseCorrection
from humanmm.models.motion.networks.sequence import (
    RATE_HZ,
    MotionSequence,
    joints_of,
    product,
    rotated,
    small_rotvec,
)
from humanmm.models.motion.networks.trajectory import (
    RefinedTrajectory,
    Trajectory,
    TrajectoryPredictor,
    TrajectoryRefiner,
)

Array = np.ndarray

LIMB_JOINTS = (1, 2, 4, 5, 7, 8, 16, 17, 18, 19, 20, 21)
HORIZON = 30
"""Steps over which a predicted path is compared as a whole: one second."""


def pose_loss(found: PoseCorrection, clips: MotionClips) -> Tensor:
    """Joints about the pelvis and their steps in time, angles of joints with their likelihood under stated errors."""
    true = clips.true
    corrected = replace(clips.given, rotations=found.rotations)
    gap = _about_pelvis(corrected) - _about_pelvis(true)
    steady = _steps(clips, within_shots=False)
    step = gap.diff(dim=1).norm(dim=-1).mean(dim=-1)
    angle = ((found.rotations - true.rotations) ** 2).sum(dim=(-1, -2)).div(2).add(1e-8).sqrt()
    unlikely = angle.detach() * torch.exp(-found.log_sigma) + found.log_sigma
    exists = clips.exists.float()
    total: Tensor = (
        10 * weighted_mean(gap.norm(dim=-1).mean(dim=-1), exists) + 10 * weighted_mean(step, steady)
        + 2 * weighted_mean(mean_of_joints(angle), exists) + 0.2 * weighted_mean(mean_of_joints(unlikely), exists)
    )  # fmt: skip
    return total


def trajectory_loss(found: Trajectory, clips: MotionClips) -> Tensor:
    """Contacts; velocities with their likelihood under the stated errors (Laplace), alone and summed over a second."""
    exists, steady = clips.exists.float(), _steps(clips, within_shots=True)
    contacts = nn.functional.binary_cross_entropy_with_logits(found.contacts, clips.contacts, reduction="none")
    gap = (found.velocity[:, :-1] - true_velocity(clips.true)) * steady[..., None]
    unlikely = gap.abs() * torch.exp(-found.log_sigma[:, :-1]) + found.log_sigma[:, :-1]
    # the path of a second in world axes: errors that last count
    world = rotated(clips.true.rotations[:, :-1, 0], gap) / RATE_HZ
    total = nn.functional.avg_pool1d(world.transpose(1, 2), HORIZON, 5) * HORIZON
    loss: Tensor = (
        weighted_mean(contacts.mean(dim=-1), exists)
        + weighted_mean(unlikely.mean(dim=-1), steady)
        + 3 * total.norm(dim=1).mean()
    )
    if isinstance(found, RefinedTrajectory):
        wanted = _turn(clips)
        loss = loss + 2 * weighted_mean((found.turn - wanted).norm(dim=-1), exists)
    return loss


def true_velocity(motion: MotionSequence) -> Tensor:
    """(B,n-1,3): of the pelvis in the root's axes, m/s."""
    return rotated(motion.rotations[:, :-1, 0].transpose(-1, -2), motion.pelvis.diff(dim=1) * RATE_HZ)


def _turn(clips: MotionClips) -> Tensor:
    """(B,n,3): what the given root lacks, as the rotation vector of a small rotation."""
    R_given_true = product(clips.given.rotations[:, :, 0].transpose(-1, -2), clips.true.rotations[:, :, 0])
    return small_rotvec(R_given_true)


def _steps(clips: MotionClips, *, within_shots: bool) -> Tensor:
    """(B,n-1): 1 where a step has both its frames, and its shot does not end."""
    steps = (clips.exists[:, 1:] & clips.exists[:, :-1]).float()
    return steps * clips.given.steps_within_shots if within_shots else steps


def _about_pelvis(motion: MotionSequence) -> Tensor:
    return joints_of(motion) - motion.pelvis[:, :, None]


@dataclass(frozen=True)
class PoseScore:
    """Errors of bodies over frames of clips: median, mean."""

    mpjpe_mm: tuple[float, float]
    """12 limb joints about the pelvis, world axes."""
    root_deg: tuple[float, float]
    acceleration: tuple[float, float]
    """Of the same joints, error in m/s²."""


@dataclass(frozen=True)
class TrajectoryScore:
    """Errors of paths over frames of clips."""

    contact_f1: float
    velocity_ms: tuple[float, float]
    """Median, mean."""
    second_m: tuple[float, float]
    """Path of a second: median, mean."""


def pose_score(network: MsHmr | None, clips: Sequence[MotionClips]) -> PoseScore:
    """How good poses are; None: as the fit gives them."""
    rows = [np.concatenate(part) for part in zip(*(_pose_rows(network, one) for one in clips), strict=True)]
    mpjpe, root, acceleration = (median_and_mean(row) for row in rows)
    return PoseScore(mpjpe, root, acceleration)


def _pose_rows(network: MsHmr | None, clips: MotionClips) -> tuple[Array, Array, Array]:
    given = clips.given
    if network is not None:
        with torch.inference_mode():
            given = replace(given, rotations=network(given).rotations)
    gap = (_about_pelvis(given) - _about_pelvis(clips.true))[:, :, list(LIMB_JOINTS)]
    R = product(given.rotations[:, :, 0].transpose(-1, -2), clips.true.rotations[:, :, 0])
    angle = torch.rad2deg(torch.arccos(((R.diagonal(dim1=-2, dim2=-1).sum(-1) - 1) / 2).clamp(-1, 1)))
    known = clips.exists & clips.given.known
    acceleration = (gap.diff(n=2, dim=1) * RATE_HZ**2).norm(dim=-1).mean(dim=-1)
    three = known[:, 2:] & known[:, 1:-1] & known[:, :-2]
    rows = (1000 * gap.norm(dim=-1).mean(dim=-1))[known], angle[known], acceleration[three]
    return rows[0].numpy(), rows[1].numpy(), rows[2].numpy()


def trajectory_score(
    predictor: TrajectoryPredictor | None, refiner: TrajectoryRefiner | None, clips: Sequence[MotionClips]
) -> TrajectoryScore:
    """How good paths and contacts are; without networks: the path as the cameras show it, no contacts."""
    counts, velocities, seconds = np.zeros(3), [], []
    for one in clips:
        steady = _steps(one, within_shots=True) > 0
        velocity, contacts = true_velocity(one.given), torch.zeros_like(one.contacts) - 1
        if predictor is not None:
            with torch.inference_mode():
                found = predictor(one.given)
                found = refiner(one.given, found) if refiner is not None else found
            velocity, contacts = found.velocity[:, :-1], found.contacts
        gap = (velocity - true_velocity(one.true)) * steady[..., None]
        velocities.append(gap.norm(dim=-1)[steady].numpy())
        world = rotated(one.true.rotations[:, :-1, 0], gap) / RATE_HZ
        whole = nn.functional.avg_pool1d(steady.float()[:, None], HORIZON, 5)[:, 0] > 0.99
        total = (nn.functional.avg_pool1d(world.transpose(1, 2), HORIZON, 5) * HORIZON).norm(dim=1)
        seconds.append(total[whole].numpy())
        stands, said = one.contacts[one.exists] > 0.5, contacts[one.exists] > 0
        counts += [(stands & said).sum().item(), (stands & ~said).sum().item(), (~stands & said).sum().item()]
    hit, missed, false = counts
    f1 = 2 * hit / max(2 * hit + missed + false, 1)
    return TrajectoryScore(
        float(f1), median_and_mean(np.concatenate(velocities)), median_and_mean(np.concatenate(seconds))
    )
