"""Two people in contact, each looked at without the other."""

from collections.abc import Sequence

import numpy as np

from humanmm.models.perception.contact import looked_at_apart, touching
from humanmm.models.perception.interfaces import Detection, Landmarks, Networks
from humanmm.models.perception.observation import Observation
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import Region
from humanmm.models.records import landmarks

SIDE = 160.0
LIMB_PLACES = np.array(
    [[10, -30], [-10, -30], [14, -10], [-14, -10], [16, 8], [-16, 8], [7, 8], [-7, 8], [8, 30], [-8, 30], [8, 50],
     [-8, 50]]
)  # fmt: skip
"""From the hips, pixels: shoulders, elbows, wrists, hips, knees, ankles."""


def body(x: float) -> np.ndarray:
    """Landmarks of somebody who stands at x."""
    keypoints = np.column_stack([np.full(33, x), np.full(33, 90.0), np.ones(33)])
    keypoints[list(landmarks.LIMBS), :2] = LIMB_PLACES + np.array([x, 100])
    return keypoints


def person(x: float) -> Observation:
    region, box = Region(x, 100.0, SIDE), np.array([x - 20, 60, x + 20, 155])
    return Observation(body(x), np.zeros((33, 3)), box, 0.9, np.ones((128, 128), np.uint8), region, region)


def detection(x: float) -> Detection:
    keypoints = np.column_stack([np.full(17, x), np.full(17, 70.0), np.ones(17)])
    keypoints[list(landmarks.COCO_LIMBS), :2] = LIMB_PLACES + np.array([x, 100])
    return Detection(0.8, Region(x, 100.0, SIDE), np.array([x - 20, 60, x + 20, 155]), keypoints)


class Looks:
    """A detector that sees people at some places, and a pose network that keeps what it was shown."""

    def __init__(self, places: Sequence[float], moved_px: float) -> None:
        self.places, self.moved_px = places, moved_px
        self.shown: list[np.ndarray] = []

    def detect(self, image: Picture, within: Region) -> list[Detection]:
        return [detection(x) for x in self.places]

    def locate(self, image: Picture, region: Region, *, mirrored: bool = False) -> Landmarks:
        self.shown.append(image.planes[0].copy())
        mask = np.full((128, 128), 255, np.uint8)
        return Landmarks(body(region.x + self.moved_px), np.zeros((33, 3)), 0.99, mask, region, region)

    @property
    def networks(self) -> Networks:
        return Networks(self.detect, self.locate)


def dark() -> Picture:
    chroma = np.full((100, 150), 128, np.uint8)
    return Picture((np.full((200, 300), 20, np.uint8), chroma, chroma.copy()))


A, B = 130.0, 152.0


def test_neither_network_sees_the_others_limbs_and_both_see_their_own() -> None:
    looks, image = Looks((B, A), moved_px=1.0), dark()
    seen = looked_at_apart(looks.networks, image, person(A), person(B))
    assert seen is not None
    np.testing.assert_allclose([one.keypoints[11, 0] for one in seen], [A + 11, B + 11])
    outer_knee = [(130, int(A) - 8), (130, int(B) + 8)]
    for shown, own, other in zip(looks.shown, outer_knee, outer_knee[::-1], strict=True):
        assert shown[own] == 20
        assert shown[other] > 100
    assert (image.planes[0] == 20).all()


def test_who_looks_unlike_himself_without_the_other_stays_as_he_was() -> None:
    seen = looked_at_apart(Looks((A, B), moved_px=60.0).networks, dark(), person(A), person(B))
    assert seen is not None
    np.testing.assert_array_equal(seen[0].keypoints, body(A))


def test_where_the_detector_sees_one_body_nothing_is_known() -> None:
    assert looked_at_apart(Looks((A,), 1.0).networks, dark(), person(A), person(B)) is None
    assert looked_at_apart(Looks((A, 260.0), 1.0).networks, dark(), person(A), person(B)) is None


def test_people_touch_where_their_boxes_overlap() -> None:
    assert touching(person(A), person(B))
    assert not touching(person(A), person(A + 60))
