"""How the limbs of two networks become one."""

import numpy as np
from seen_by_two import LIMBS, SIDE, body, thunder

from humanmm.models.perception.keypoints.fusion import THUNDER, fused
from humanmm.models.records import landmarks


def test_limbs_lie_between_both_hands_and_feet_move_along_and_the_face_is_blazeposes() -> None:
    own = body()
    limbs = np.add(thunder(own), [2.0, 0.0, 0.0])
    both, _ = fused(own, limbs, SIDE)
    np.testing.assert_allclose(both[11:, :2] - own[11:, :2], np.tile([2.0 * THUNDER, 0.0], (22, 1)))
    np.testing.assert_array_equal(both[:11], own[:11])
    np.testing.assert_array_equal(both[:, 2], own[:, 2])


def test_far_apart_thunder_is_believed_if_it_is_sure_of_itself() -> None:
    own = body()
    limbs = thunder(own)
    limbs[[0, 1], 0] += 20.0
    limbs[1, 2] = 0.1
    both, _ = fused(own, limbs, SIDE)
    np.testing.assert_allclose(both[LIMBS[0], :2], limbs[0, :2])
    np.testing.assert_allclose(both[LIMBS[1], :2], own[LIMBS[1], :2])


def test_far_apart_wrists_are_blazeposes_and_a_foot_goes_where_its_ankle_goes() -> None:
    own = body()
    limbs = thunder(own)
    wrist, ankle = landmarks.INDEX["left_wrist"], landmarks.INDEX["right_ankle"]
    limbs[[LIMBS.index(wrist), LIMBS.index(ankle)], 0] += 20.0
    both, agreement = fused(own, limbs, SIDE)
    moved = [ankle, *landmarks.BEYOND[ankle]]
    np.testing.assert_allclose(both[moved, 0] - own[moved, 0], 20.0)
    np.testing.assert_array_equal(np.delete(both, moved, axis=0), np.delete(own, moved, axis=0))
    doubtful = [*moved, wrist, *landmarks.BEYOND[wrist]]
    np.testing.assert_allclose(agreement[doubtful], 0.3)
    np.testing.assert_allclose(np.delete(agreement, doubtful), 1.0)


def test_a_limb_is_the_less_visible_the_farther_apart_the_two_put_it() -> None:
    own = body()
    limbs = thunder(own)
    limbs[:4, 0] += [5.0, 7.0, 8.0, 40.0]  # percent of the height
    keypoints, agreement = fused(own, limbs, SIDE)
    np.testing.assert_allclose(agreement[LIMBS[:4]], [1.0, 0.75, 0.5, 0.3])
    np.testing.assert_allclose(np.delete(agreement, LIMBS[:4]), 1.0)
    np.testing.assert_allclose(keypoints[:, 2], 0.9)
