"""The hand network on a real picture, a man of 600 pixels whose hands are 50."""

import numpy as np

from humanmm.models.perception.hands.crops import of_body, of_points
from humanmm.models.perception.hands.network import Hand, look
from humanmm.models.perception.keypoints.fusion import locate_best
from humanmm.models.perception.movenet import detect
from humanmm.models.perception.picture import Picture, whole
from humanmm.models.perception.regions import Region


def test_a_real_hand_is_seen_at_the_wrist_and_turns_with_its_crop(clip_picture: Picture) -> None:
    (found,) = detect(clip_picture, whole(clip_picture))
    keypoints = locate_best(clip_picture, found.region).keypoints
    region = of_body(keypoints, 1)
    assert region is not None
    again = of_points(look(clip_picture, region).points)
    hand = look(clip_picture, again)
    assert hand.presence > 0.6
    assert np.linalg.norm(hand.points[0] - keypoints[16, :2]) < 0.25 * region.side
    turned = look(clip_picture, Region(again.x, again.y, again.side, again.angle + 0.2))
    assert np.linalg.norm(turned.points - hand.points, axis=1).mean() < 0.1 * again.side
    bones = [np.diff(one.points3d[[0, 5, 9, 17]], axis=0).ravel() for one in (hand, turned)]
    assert bones[0] @ bones[1] > 0.9 * np.linalg.norm(bones[0]) * np.linalg.norm(bones[1])


def test_where_there_is_no_hand_none_is_seen(clip_picture: Picture) -> None:
    assert look(clip_picture, Region(100, 100, 120)).presence < 0.3


def test_confidence_is_in_a_hand_of_that_side() -> None:
    hand = Hand(np.zeros((21, 2)), np.zeros((21, 3)), presence=0.8, right=0.25)
    assert (hand.confidence(0), hand.confidence(1)) == (0.8 * 0.75, 0.8 * 0.25)
