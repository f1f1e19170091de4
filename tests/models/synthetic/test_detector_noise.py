"""What the simulated pose network gets wrong, and when its errors change."""

from dataclasses import replace

import numpy as np

from humanmm.models.synthetic.detector_noise import AXES, LIMBS, PARTS, TRUNK, Detections, detect, fitted_noise, speeds

FPS, SIZE = 30.0, (10_000, 10_000)
K = np.array([[1000.0, 0, 5000], [0, 1000, 5000], [0, 0, 1]])
SHAPE = np.random.default_rng(0).uniform([-0.3, -0.9, 4.9], [0.3, 0.9, 5.1], (33, 3))
NO_EVENTS = {"hidden_rate": (0, 0), "lost_rate": (0, 0), "swap_rate": (0, 0), "miss_rate": 0.0}
WAVING, STANDING = [13, 15, 17, 19, 21], [27, 28, 29, 30, 31, 32]


def waving(num_frames: int) -> np.ndarray:
    """A left arm that moves at a meter a second while the rest stands."""
    points = np.tile(SHAPE, (num_frames, 1, 1))
    points[:, WAVING, 0] += 0.3 * np.sin(np.arange(num_frames) / FPS * 3.3)[:, None]
    return points


def seen(points: np.ndarray, **changes: object) -> Detections:
    noise, n = replace(fitted_noise(), **changes), len(points)
    zero = np.zeros(n)
    behind = np.zeros(n, bool)
    return detect(points, K, SIZE, behind, 1.0, FPS, noise, np.random.default_rng(1), pitch=zero, roll=zero)


def own_sizes() -> np.ndarray:
    """How far every landmark errs in the picture, of all that are fitted one on average (33, 2)."""
    patterns, sizes = fitted_noise().patterns, np.ones((33, 2))
    for part, covariance in (
        (TRUNK, patterns.trunk),
        *zip(LIMBS, (patterns.arm,) * 2 + (patterns.leg,) * 2, strict=True),
    ):
        sizes[list(part)] = np.sqrt(np.diagonal(covariance).reshape(-1, AXES)[:, :2])
    return sizes


def test_what_stands_keeps_its_error_and_what_moves_does_not() -> None:
    points = waving(600)
    found = seen(points, **NO_EVENTS, shot_fraction=0.0, new_fraction=0.0)
    true = (points @ K.T)[..., :2] / points[..., 2:]
    change = np.diff(found.keypoints[..., :2] - true, axis=0)
    assert change[:, WAVING].std() > 1.3 * change[:, STANDING].std()


def test_an_error_is_as_large_on_what_moves_as_on_what_stands() -> None:
    points = waving(3000)
    found = seen(points, **NO_EVENTS, shot_fraction=0.0)
    error = found.keypoints[..., :2] - (points @ K.T)[..., :2] / points[..., 2:]
    assert 0.8 < (error / own_sizes())[:, WAVING].std() / (error / own_sizes())[:, STANDING].std() < 1.25


def test_what_is_new_in_every_frame_is_so_whatever_moves() -> None:
    points = waving(600)
    found = seen(points, **NO_EVENTS, shot_fraction=0.0, new_fraction=1.0)
    error = found.keypoints[..., 0] - (points @ K.T)[..., 0] / points[..., 2]
    following = np.corrcoef(error[1:, STANDING].ravel(), error[:-1, STANDING].ravel())[0, 1]
    assert abs(following) < 0.05


def test_limbs_that_stand_are_lost_more_rarely() -> None:
    still = {**NO_EVENTS, "lost_rate": (1.0, 1.0), "lost_fraction": 0.5, "keypoint_fraction": 0.0}
    points = waving(9000)
    found = seen(points, **still)
    far = np.abs(found.keypoints[..., :2] - (points @ K.T)[..., :2] / points[..., 2:]).max(axis=-1) > 1.0
    begins = (far[1:] & ~far[:-1]).sum(axis=0)
    assert begins[WAVING[0]] > 1.5 * begins[STANDING[0]] > 0


def test_the_way_is_that_of_each_part_about_the_body() -> None:
    points = waving(120)
    speed = speeds((points @ K.T)[..., :2] / points[..., 2:], FPS)
    assert speed.shape == (120, len(PARTS))
    assert speed[:, 2].mean() > 0.3
    assert np.delete(speed, 2, axis=1).mean() < 0.06  # the middle of the body moves a little as well
    assert np.allclose(speeds(np.zeros((1, 33, 2)), FPS), 0)


def test_a_hand_and_its_fingers_err_together_and_both_arms_alike_in_the_mirror() -> None:
    points = waving(6000)
    found = seen(points, **NO_EVENTS, shot_fraction=0.0, new_fraction=0.0)
    error = found.keypoints[..., :2] - (points @ K.T)[..., :2] / points[..., 2:]
    left, right = (np.cov(error[:, list(limb)].reshape(len(points), -1).T) for limb in LIMBS[:2])
    side = np.tile([-1.0, 1.0], len(LIMBS[0]))
    assert np.corrcoef(error[:, 15, 0], error[:, 19, 0])[0, 1] > 0.6
    assert np.abs(left - right * np.outer(side, side)).max() < 0.3 * np.abs(left).max()


def test_some_hidden_limbs_are_nearly_right_and_others_far_off() -> None:
    points = waving(9000)
    found = seen(points, lost_rate=(0, 0), swap_rate=(0, 0), miss_rate=0.0, hidden_rate=(3.0, 3.0))
    error = np.abs(found.keypoints[..., :2] - (points @ K.T)[..., :2] / points[..., 2:])
    arm = list(LIMBS[0])
    hidden = found.keypoints[:, arm, 2].mean(axis=1) < 0.6
    assert 0.05 < hidden.mean() < 0.95
    sizes = {name: error[rows][:, arm] for name, rows in (("hidden", hidden), ("seen", ~hidden))}
    tails = {name: np.quantile(size, 0.95) / np.median(size) for name, size in sizes.items()}
    assert np.median(sizes["hidden"]) > 1.3 * np.median(sizes["seen"])
    assert tails["hidden"] > 1.5 * tails["seen"]
