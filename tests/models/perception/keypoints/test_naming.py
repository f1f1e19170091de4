"""Whose left is whose."""

import numpy as np
from seen_by_two import SIDE, body, thunder

from humanmm.models.perception.keypoints.fusion import fused
from humanmm.models.perception.keypoints.naming import CROSSED_ODDS, body_named_as, is_crossed, named_as, side_odds
from humanmm.models.records import landmarks


def test_left_and_right_are_named_as_the_network_with_the_depths_names_them() -> None:
    own = body()
    exchanged = thunder(own).reshape(6, 2, 3)[:, ::-1].reshape(12, 3)
    np.testing.assert_allclose(named_as(own, exchanged, SIDE), thunder(own))
    np.testing.assert_allclose(fused(own, named_as(own, exchanged, SIDE), SIDE)[0], own, atol=1e-9)
    legs_alone = thunder(own)
    legs_alone[6:] = exchanged[6:]
    np.testing.assert_allclose(named_as(own, legs_alone, SIDE), thunder(own))
    np.testing.assert_allclose(fused(own, named_as(own, legs_alone, SIDE), SIDE)[0], own, atol=1e-9)
    assert is_crossed(own, exchanged, SIDE) and not is_crossed(own, thunder(own), SIDE)
    for share in np.linspace(0, 1, 41):
        limbs = (1 - share) * thunder(own) + share * exchanged
        assert (side_odds(own, limbs, SIDE) < CROSSED_ODDS) == is_crossed(own, limbs, SIDE)


def test_arms_with_hands_and_legs_with_feet_are_named_as_another_network_names_them() -> None:
    own = body()
    legs = [k for k in range(33) if k >= landmarks.INDEX["left_hip"]]
    arms = [k for k in range(11, 33) if k not in legs]
    for part in (arms, legs, arms + legs):
        exchanged = own.copy()
        exchanged[part] = own[landmarks.SWAP[part]]
        np.testing.assert_array_equal(body_named_as(own, exchanged, SIDE), own)
    np.testing.assert_array_equal(body_named_as(own, own, SIDE), own)


def test_odds_of_the_sides_follow_by_how_much_the_limbs_fit_better_one_way() -> None:
    own = body()
    exchanged = thunder(own).reshape(6, 2, 3)[:, ::-1].reshape(12, 3)
    between = 0.5 * (thunder(own) + exchanged)
    agreed, even, crossed = (side_odds(own, limbs, SIDE) for limbs in (thunder(own), between, exchanged))
    assert agreed > 0 > even > crossed
    assert crossed < -agreed, "swaps are rarely imagined, and often overlooked by both networks"
