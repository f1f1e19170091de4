"""Rotation averaging over shots: exact evidence is met, chance links are refused, strong links overrule people."""

import numpy as np
import roma
import torch

from humanmm.models.motion.world.shot_rotations import RotationEdge, average_rotations


def rotations(count: int, seed: int = 0) -> np.ndarray:
    torch.manual_seed(seed)
    R = roma.random_rotmat(count, dtype=torch.float64).numpy()
    R[0] = np.eye(3)
    return R


def edge(R: np.ndarray, a: int, b: int, sigma_deg: float, num_inliers: int = 0, off_deg: float = 0.0) -> RotationEdge:
    off = roma.rotvec_to_rotmat(torch.tensor([0.0, np.radians(off_deg), 0.0], dtype=torch.float64)).numpy()
    return RotationEdge(a, b, R[a].T @ R[b] @ off, sigma_deg, num_inliers)


def angle_deg(R: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip((np.trace(R) - 1) / 2, -1, 1))))


def test_consistent_edges_are_met_exactly() -> None:
    R = rotations(5)
    people = [edge(R, k, k + 1, 8.0) for k in range(4)]
    answer = average_rotations(5, people, [edge(R, 0, 4, 2.0, 90)])
    np.testing.assert_allclose(answer.R_group_shot, R, atol=1e-9)
    assert set(answer.group) == {0}


def test_a_strong_background_link_takes_the_error_out_of_a_cut() -> None:
    R = rotations(2)
    answer = average_rotations(2, [edge(R, 0, 1, 10.0, off_deg=12)], [edge(R, 0, 1, 1.0, 80)])
    assert angle_deg(answer.R_group_shot[1].T @ R[1]) < 0.5


def test_a_returning_camera_halves_the_error_of_the_shot_between() -> None:
    R = rotations(3)
    people = [edge(R, 0, 1, 8.0, off_deg=10), edge(R, 1, 2, 8.0)]
    alone = average_rotations(3, people, [])
    closed = average_rotations(3, people, [RotationEdge(0, 2, R[0].T @ R[2], 0.1, 900, same_camera=True)])
    assert angle_deg(closed.R_group_shot[2].T @ R[2]) < 0.2
    assert angle_deg(closed.R_group_shot[1].T @ R[1]) < 0.7 * angle_deg(alone.R_group_shot[1].T @ R[1])


def test_a_weak_link_far_from_what_the_people_say_is_refused() -> None:
    R = rotations(2)
    answer = average_rotations(2, [edge(R, 0, 1, 6.0)], [edge(R, 0, 1, 4.0, 18, off_deg=90)])
    assert len(answer.rejected) == 1
    assert angle_deg(answer.R_group_shot[1].T @ R[1]) < 1e-6


def test_shots_that_share_nothing_stay_in_groups_of_their_own() -> None:
    R = rotations(4)
    answer = average_rotations(4, [edge(R, 0, 1, 5.0), edge(R, 2, 3, 5.0)], [edge(R, 1, 2, 4.0, 20)])
    assert answer.group == (0, 0, 2, 2)
    assert len(answer.rejected) == 1  # a weak link for which nobody vouches
