"""Where people are looked for, and painting out who was found."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.perception.interfaces import Detection, Landmarks
from humanmm.models.perception.keypoints.fusion import BEST
from humanmm.models.perception.observation import Observation
from humanmm.models.perception.picture import Picture, whole
from humanmm.models.perception.regions import Region
from humanmm.models.perception.tracking.painting import covered_fraction, detected_keypoints, paint_out, without
from humanmm.models.perception.tracking.search import (
    CLOSE_UP,
    detections,
    find_people,
    lies_on,
    same_person,
    same_shoulders,
    settle,
    tiles,
)
from humanmm.models.records import landmarks

ELBOWS = [landmarks.INDEX[f"{side}_elbow"] for side in ("left", "right")]


def gray(width: int, height: int, value: int = 60) -> Picture:
    chroma = np.full((height // 2, width // 2), 128, np.uint8)
    return Picture((np.full((height, width), value, np.uint8), chroma, chroma.copy()))


def person(x: float, y: float, side: float = 128.0) -> Observation:
    region = Region(x, y, side)
    mask = np.zeros((128, 128), np.uint8)
    mask[32:96, 48:80] = 1
    keypoints = np.column_stack([x + np.linspace(-20, 20, 33), y + np.linspace(-40, 40, 33), np.ones(33)])
    return Observation(keypoints, np.zeros((33, 3)), np.array([x, y, x, y]), 0.9, mask, region, region)


def standing(x: float) -> Observation:
    """Somebody who stands upright, all joints on one vertical line."""
    keypoints = np.column_stack([np.full(33, x), np.full(33, 150.0), np.ones(33)])
    for joints, y in (
        (range(11), 110.0),
        (landmarks.SHOULDERS, 120.0),
        (landmarks.HIPS, 150.0),
        (landmarks.ANKLES, 180.0),
    ):
        keypoints[list(joints), 1] = y
    return replace(person(120, 150), keypoints=keypoints)


@pytest.mark.parametrize("size", [(640, 360), (360, 640), (1920, 1080), (320, 320)])
def test_the_tiles_cover_the_frame_and_enlarge_its_parts(size: tuple[int, int]) -> None:
    image = gray(*size)
    covered = np.zeros(size[::-1], bool)
    for tile in tiles(image):
        assert tile.side <= whole(image).side / 1.3
        left, top = (round(max(0.0, c - tile.side / 2)) for c in (tile.x, tile.y))
        covered[top : round(tile.y + tile.side / 2), left : round(tile.x + tile.side / 2)] = True
    assert covered.all()


def test_who_is_painted_out_is_covered_and_who_stands_beside_is_not() -> None:
    canvas, painted = gray(400, 300), np.zeros((300, 400), np.uint8)
    paint_out(canvas, person(120, 150), painted)
    assert covered_fraction(painted, person(120, 150)) == 1.0
    assert covered_fraction(painted, person(260, 150)) == 0.0
    half = covered_fraction(painted, person(120, 150 + 32))
    assert half == pytest.approx(0.5, abs=0.06)  # the painted mask is widened by two of its 64 rows
    luma = canvas.planes[0]
    assert (luma[painted == 1] != 60).all() and (luma[painted == 0] == 60).all()


def test_what_is_nearer_to_the_bones_of_somebody_else_is_not_painted() -> None:
    """A silhouette that covers two: its right half lies nearer to the second, who stands 16 pixels beside the first."""
    canvas, painted = gray(400, 300), np.zeros((300, 400), np.uint8)
    first, second = standing(116), standing(132)
    paint_out(canvas, first, painted, spared=second.keypoints)
    left, right = painted[130:170, 106:123], painted[130:170, 126:140]
    assert left.all() and not right.any()
    whole_canvas, covered = without(gray(400, 300), [first])
    assert covered[130:170, 106:138].all() and (whole_canvas.planes[0][covered == 1] != 60).all()


def test_a_body_that_the_detector_sees_twice_has_one_pair_of_shoulders() -> None:
    seen = standing(120)
    beside = Detection(0.5, seen.region, seen.bbox, standing(150).keypoints[list(landmarks.COCO_LANDMARKS)])
    again = Detection(0.5, seen.region, seen.bbox, standing(123).keypoints[list(landmarks.COCO_LANDMARKS)])
    joints = [detected_keypoints(one) for one in (beside, again)]
    assert all(one is not None for one in joints)
    assert [same_shoulders(seen, one) for one in joints if one is not None] == [False, True]
    assert detected_keypoints(Detection(0.5, seen.region, seen.bbox)) is None


def test_one_body_seen_twice_is_the_same_person() -> None:
    assert same_person(person(100, 100), person(103, 101))
    assert not same_person(person(100, 100), person(160, 100))


def test_nobody_is_found_in_an_empty_picture() -> None:
    image = gray(320, 240)
    assert find_people(BEST, image, [], [], behind=True, closer=True, limit=3) == []


def coco_of(seen: Observation, beside: float = 3.0) -> np.ndarray:
    """Keypoints of a detector that lie beside a pose by so many pixels."""
    return seen.keypoints[list(landmarks.COCO_LANDMARKS)] + [beside, 0.0, 0.0]


def test_a_pose_lies_on_a_detection_by_its_keypoints_or_else_by_its_region() -> None:
    seen = person(100, 100)
    assert lies_on(seen, Detection(0.5, Region(300, 300, 10), seen.bbox, coco_of(seen)))
    assert not lies_on(seen, Detection(0.5, seen.region, seen.bbox, coco_of(seen, beside=60.0)))
    assert lies_on(seen, Detection(0.5, Region(110, 100, 150), seen.bbox))
    assert not lies_on(seen, Detection(0.5, Region(180, 100, 128), seen.bbox))


def test_a_pose_lies_on_a_detection_that_names_left_and_right_the_other_way() -> None:
    seen = person(100, 100)
    wide = seen.keypoints.copy()
    wide[list(landmarks.SHOULDERS), 0] = [60.0, 140.0]
    wide[list(ELBOWS), 0] = [50.0, 150.0]
    wide[list(landmarks.WRISTS), 0] = [40.0, 160.0]
    close_up = replace(seen, keypoints=wide)
    keypoints = coco_of(close_up)
    keypoints[:5, 2], keypoints[11:, 2] = 0.0, 0.0  # of the arms alone
    assert lies_on(close_up, Detection(0.5, Region(300, 300, 10), seen.bbox, keypoints[landmarks.COCO_SWAP]))


def test_keypoints_that_the_detector_does_not_see_do_not_say_whose_pose_it_is() -> None:
    seen = person(100, 100)
    keypoints = coco_of(seen)
    keypoints[9:] = [400.0, 400.0, 0.05]  # of a close-up the legs are a guess
    assert lies_on(seen, Detection(0.5, Region(300, 300, 10), seen.bbox, keypoints))
    keypoints[4:, 2] = 0.0  # four keypoints say nothing; the region is far away
    assert not lies_on(seen, Detection(0.5, Region(300, 300, 10), seen.bbox, keypoints))


def test_a_guessed_crop_is_looked_at_again_until_the_pose_lies_on_the_person_detected() -> None:
    """Of a close-up the detector guesses where the hips are; a pose that slides away again does not count."""
    there, elsewhere = person(100, 100), person(300, 100)
    detection = Detection(0.5, Region(140, 140, 128), there.bbox, coco_of(there))

    def settled(*poses: Observation) -> Observation | None:
        looks = iter(poses)
        return settle(lambda *_, **__: landmarks_of(next(looks)), gray(400, 300), detection)

    far = settled(elsewhere, there, there)
    assert far is not None and np.allclose(far.keypoints[:, :2], there.keypoints[:, :2])
    near = settled(there, elsewhere, elsewhere)
    assert near is not None and np.allclose(near.keypoints[:, :2], there.keypoints[:, :2])
    assert settled(elsewhere, elsewhere, elsewhere) is None


@pytest.mark.parametrize(("hips", "found"), [(0.0, True), (0.9, False)])
def test_a_close_up_is_looked_at_in_a_larger_region_than_the_detector_guesses(hips: float, found: bool) -> None:
    there, elsewhere = person(100, 100), person(300, 100, side=64)
    keypoints = coco_of(there)
    keypoints[11:13, 2] = hips
    detection = Detection(0.5, Region(100, 100, 64), there.bbox, keypoints)

    def locate(image: Picture, region: Region, **_: object) -> Landmarks:
        return landmarks_of(there if region.side >= CLOSE_UP * 64 else elsewhere)

    assert (settle(locate, gray(400, 300), detection) is not None) is found


def landmarks_of(seen: Observation) -> Landmarks:
    """The network's output that is observed so."""
    return Landmarks(
        seen.keypoints, seen.landmarks3d, 1.0, np.full((128, 128), 255, np.uint8), seen.region, seen.next_region
    )


def test_who_fills_the_picture_is_looked_at_from_farther_away() -> None:
    image = gray(400, 300)
    large, better = np.array([20.0, 0.0, 300.0, 300.0]), np.array([25.0, 0.0, 300.0, 300.0])
    small = np.array([310.0, 100.0, 360.0, 220.0])
    region = Region(1, 1, 1)

    def detect(_: Picture, within: Region) -> list[Detection]:
        near = within.side == 400
        return [Detection(0.3, region, large), Detection(0.4, region, small)] if near else [
            Detection(0.7, region, better), Detection(0.9, region, small + 2)
        ]  # fmt: skip

    found = detections(detect, image)
    assert [one.score for one in found] == [0.7, 0.4]
    assert found[0].box is better and found[1].box is small


def test_a_man_cut_at_the_knees_who_fills_the_picture_is_found_surely(clip_picture: Picture) -> None:
    (man,) = detections(BEST.detect, clip_picture)
    left, top, right, bottom = man.box
    part, _ = clip_picture.part(np.array([left, top]), np.array([right, top + 0.7 * (bottom - top)]))
    near = max((one.score for one in BEST.detect(part, whole(part))), default=0.0)
    far = max(one.score for one in detections(BEST.detect, part))
    assert far > near + 0.1
