"""The losses are least for the truth; scores of the truth are perfect."""

from dataclasses import replace

import numpy as np
import torch
from motion_clips_of_pairs import OFF_RAD, source

from humanmm.models.geometry.rotations import rotmat_to_rotvec
from humanmm.models.learning.training.motion_objective import (
    pose_loss,
    pose_score,
    trajectory_loss,
    trajectory_score,
    true_velocity,
)
from humanmm.models.motion.networks.ms_hmr import PoseCorrection
from humanmm.models.motion.networks.trajectory import RefinedTrajectory, Trajectory

CLIPS = source().draw(4, np.random.default_rng(0))


def test_true_poses_cost_less_than_those_of_the_fit() -> None:
    sure = torch.full(CLIPS.given.rotations.shape[:3], -3.0)
    right, wrong = (float(pose_loss(PoseCorrection(m.rotations, sure), CLIPS)) for m in (CLIPS.true, CLIPS.given))
    assert right < wrong - 0.2


def test_true_paths_and_contacts_cost_less_than_others() -> None:
    velocity = true_velocity(CLIPS.true)
    velocity = torch.cat([velocity, velocity[:, -1:]], dim=1)
    sure, contacts = torch.full_like(velocity, -3.0), 20 * (CLIPS.contacts - 0.5)
    best = float(trajectory_loss(Trajectory(contacts, velocity, sure), CLIPS))
    assert float(trajectory_loss(Trajectory(-contacts, velocity, sure), CLIPS)) > best + 0.1
    assert float(trajectory_loss(Trajectory(contacts, velocity + 0.2, sure), CLIPS)) > best + 0.1
    lacking = CLIPS.given.rotations[:, :, 0].transpose(-1, -2) @ CLIPS.true.rotations[:, :, 0]
    turn = torch.from_numpy(rotmat_to_rotvec(lacking.double().numpy())).float()
    refined = (RefinedTrajectory(contacts, velocity, sure, t) for t in (turn, torch.zeros_like(turn)))
    right, nothing = (float(trajectory_loss(one, CLIPS)) for one in refined)
    assert right < nothing


def test_scores_of_the_truth_are_perfect_and_those_of_the_fit_are_its_errors() -> None:
    perfect = pose_score(None, [replace(CLIPS, given=CLIPS.true)])
    assert perfect.mpjpe_mm[0] == 0 and perfect.root_deg[1] < 0.1
    fitted = pose_score(None, [CLIPS])
    assert abs(fitted.root_deg[0] - np.degrees(OFF_RAD)) < 0.5 and fitted.mpjpe_mm[0] > 10
    path = trajectory_score(None, None, [replace(CLIPS, given=CLIPS.true)])
    assert path.velocity_ms[1] < 1e-3 and path.contact_f1 == 0
