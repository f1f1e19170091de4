"""Where people are looked for, and painting out who was found."""

import numpy as np
import pytest

from humanmm.models.perception.fusion import BEST
from humanmm.models.perception.interfaces import Detection
from humanmm.models.perception.observation import Observation
from humanmm.models.perception.picture import Picture, whole
from humanmm.models.perception.regions import Region
from humanmm.models.perception.tracking.search import (
    covered_fraction,
    find_people,
    lies_on,
    paint_out,
    same_person,
    tiles,
)
from humanmm.models.records import landmarks


def gray(width: int, height: int, value: int = 60) -> Picture:
    chroma = np.full((height // 2, width // 2), 128, np.uint8)
    return Picture((np.full((height, width), value, np.uint8), chroma, chroma.copy()))


def person(x: float, y: float, side: float = 128.0) -> Observation:
    region = Region(x, y, side)
    mask = np.zeros((128, 128), np.uint8)
    mask[32:96, 48:80] = 1
    keypoints = np.column_stack([x + np.linspace(-20, 20, 33), y + np.linspace(-40, 40, 33), np.ones(33)])
    return Observation(keypoints, np.zeros((33, 3)), np.array([x, y, x, y]), 0.9, mask, region, region)


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


def test_one_body_seen_twice_is_the_same_person() -> None:
    assert same_person(person(100, 100), person(103, 101))
    assert not same_person(person(100, 100), person(160, 100))


def test_nobody_is_found_in_an_empty_picture() -> None:
    image = gray(320, 240)
    assert find_people(BEST, image, [], [], behind=True, closer=True, limit=3) == []


def test_a_pose_lies_on_a_detection_by_its_keypoints_or_else_by_its_region() -> None:
    seen = person(100, 100)
    keypoints = np.zeros((17, 3))
    keypoints[5:, :2] = seen.keypoints[list(landmarks.LIMBS), :2] + 3.0
    beside = np.add(keypoints, [60.0, 0.0, 0.0])
    assert lies_on(seen, Detection(0.5, Region(300, 300, 10), seen.bbox, keypoints))
    assert not lies_on(seen, Detection(0.5, seen.region, seen.bbox, beside))
    assert lies_on(seen, Detection(0.5, Region(110, 100, 150), seen.bbox))
    assert not lies_on(seen, Detection(0.5, Region(180, 100, 128), seen.bbox))
