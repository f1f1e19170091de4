"""Takes as a detector of COCO's keypoints sees them."""

import numpy as np
import pytest
from pair_windows import walk

from humanmm.models.learning import keypoint_motion
from humanmm.models.learning.keypoint_motion import KeypointMotion
from humanmm.models.perception.lifting.keypoints import COCO
from humanmm.models.records.landmarks import NUM_LANDMARKS


def test_without_errors_keypoints_lie_where_the_truth_projects_to(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("JOINT_M", "SHOULDER_M", "HIP_M", "LASTING", "TREMBLING", "DRIFTING"):
        monkeypatch.setattr(keypoint_motion, name, 0.0)
    drawn = KeypointMotion([walk()]).draw(6, np.random.default_rng(0))
    truth, points = drawn.truth.double().numpy()[:, :, COCO], drawn.points.double().numpy()[:, :, COCO]
    size = drawn.size.double().numpy()[..., None]
    # Unknown is only where the mid-hip is: three numbers of a frame, linear in what its 17 points say.
    rays = points * size[..., None]
    A = np.zeros((*points.shape, 3))
    A[..., 0, 0] = A[..., 1, 1] = 1.0
    A[..., 2] = -rays
    b = rays * truth[..., 2:] - truth[..., :2]
    rows, right = A.reshape(-1, 2 * len(COCO), 3), b.reshape(-1, 2 * len(COCO), 1)
    hips = np.linalg.pinv(rows) @ right
    assert np.abs(rows @ hips - right).max() < 1e-4
    assert (hips[:, 2] > 0.5).all()


def test_poses_turn_with_the_landmarks_and_only_cocos_keypoints_are_seen() -> None:
    drawn = KeypointMotion([walk()]).draw(8, np.random.default_rng(0))
    left = drawn.truth[:, :, 23] - drawn.truth[:, :, 24]
    left = left / left.norm(dim=-1, keepdim=True)
    assert ((drawn.pose[:, :, 0, :, 0] * left).sum(dim=-1) > 0.9).all()
    named = np.isin(np.arange(NUM_LANDMARKS), COCO)
    seen = drawn.certainty.numpy() > 0
    assert not seen[..., ~named].any() and 0.9 < seen[..., named].mean() < 1


def test_keypoints_that_are_said_to_be_unsure_are_farther_off() -> None:
    """Three fifths of the windows come with expected errors; in the others a keypoint is named or not."""
    drawn = KeypointMotion([walk()]).draw(64, np.random.default_rng(0))
    sure = drawn.certainty.numpy()[..., COCO]
    is_told = ((sure > 0) & (sure < 1)).any(axis=(1, 2))
    assert 0.4 < is_told.mean() < 0.8 and set(np.unique(sure[~is_told])) == {0.0, 1.0}
    steps = np.linalg.norm(np.diff(drawn.points.numpy()[is_told][..., COCO, :], axis=1), axis=-1)
    by_certainty = np.argsort(sure[is_told][:, 1:].ravel())
    surest, unsurest = by_certainty[-len(by_certainty) // 4 :], by_certainty[: len(by_certainty) // 4]
    assert np.median(steps.ravel()[unsurest]) > 1.5 * np.median(steps.ravel()[surest])


def test_the_seed_decides_what_is_drawn() -> None:
    motion = KeypointMotion([walk()])
    a, b, c = (motion.draw(3, np.random.default_rng(seed)).points for seed in (1, 1, 2))
    assert np.array_equal(a, b) and not np.array_equal(a, c)


def test_windows_are_as_long_as_they_are_asked_for() -> None:
    drawn = KeypointMotion([walk()]).draw(2, np.random.default_rng(0), 10)
    assert drawn.truth.shape == (2, 10, NUM_LANDMARKS, 3) and drawn.time_s.shape == (2, 10)


def test_whose_sides_are_swapped_is_known_beyond_doubt() -> None:
    """Else a training learns nothing of it."""
    drawn = KeypointMotion([walk()]).draw(2, np.random.default_rng(0))
    assert drawn.clear.all() and not drawn.swapped.any()
