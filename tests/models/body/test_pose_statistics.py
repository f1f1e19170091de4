"""The shipped statistic of poses."""

import numpy as np

from humanmm.models.body.body24 import FREE_JOINTS
from humanmm.models.body.pose_statistics import load_pose_statistics


def test_the_mixture_is_one_of_poses_within_their_limits() -> None:
    shipped = load_pose_statistics()
    assert shipped.means.shape[1] == 3 * len(FREE_JOINTS)
    np.testing.assert_allclose(shipped.shares.sum(), 1, atol=1e-6)
    one = np.tile(np.eye(57), (len(shipped.shares), 1, 1))
    np.testing.assert_allclose(shipped.precisions @ shipped.covariances, one, atol=1e-6)
    assert ((shipped.lower < shipped.mean) & (shipped.mean < shipped.upper)).all()


def test_the_mean_of_all_poses_is_that_of_the_habits() -> None:
    shipped = load_pose_statistics()
    habits = shipped.shares[:-1] / shipped.shares[:-1].sum()
    np.testing.assert_allclose(shipped.mean, habits @ shipped.means[:-1], atol=0.05)
