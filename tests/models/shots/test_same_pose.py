"""Poses on both sides of a cut."""

import numpy as np

from humanmm.models.records.landmarks import INDEX, LIMBS, SWAP
from humanmm.models.shots.same_pose import LEAST, MOST, average_pose, residual_m, same_pose_odds


def _arms_up() -> np.ndarray:
    pose = average_pose().copy()
    for side in ("left", "right"):
        for joint, above_m in (("elbow", 0.28), ("wrist", 0.53)):
            pose[INDEX[f"{side}_{joint}"]] = pose[INDEX[f"{side}_shoulder"]] + np.array([0, above_m, 0])
    return pose


def _seen(pose: np.ndarray, *, seed: int, error_m: float = 0.03) -> np.ndarray:
    """Somewhere, from somewhere, and not quite right."""
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    return (pose + rng.normal(0, error_m, pose.shape)) @ turn.T + rng.normal(size=3)


def test_the_residual_ignores_rotation_and_swapped_sides() -> None:
    pose = _arms_up()
    assert residual_m(pose, _seen(pose, seed=1, error_m=0)[SWAP]) < 1e-6
    assert residual_m(pose, average_pose()) > 0.1


def test_an_unusual_pose_that_goes_on_says_more_than_one_that_everybody_has() -> None:
    poses = average_pose(), _arms_up()
    same = [[same_pose_odds(_seen(pose, seed=k), _seen(pose, seed=k + 50)) for k in range(9)] for pose in poses]
    usual, unusual = np.median(same, axis=1)
    assert abs(usual) < 0.5 < 1 < unusual <= MOST
    other = [same_pose_odds(_seen(_arms_up(), seed=k), _seen(average_pose(), seed=k + 50)) for k in range(9)]
    assert np.median(other) == LEAST


def test_the_average_pose_stands_upright_with_arms_at_its_sides() -> None:
    pose = average_pose()
    height = pose[[INDEX["left_shoulder"], INDEX["left_elbow"], INDEX["left_hip"], INDEX["left_knee"]], 1]
    assert (np.diff(height) < 0).all()
    np.testing.assert_allclose(pose[LIMBS[0::2], :] * [-1, 1, 1], pose[LIMBS[1::2], :], atol=0.03)
