"""People in given boxes and masks, on real pixels: the shipped clip, boxes about an independent detector's points."""

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from quick_networks import QUICK

from humanmm.models.geometry.boxes import box_iou
from humanmm.models.perception.interfaces import Landmarks, Networks, PoseNetwork
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import Region
from humanmm.models.perception.tracking.given_regions import GivenRegions, _filled, _owners, sparse, track_regions
from humanmm.models.records import landmarks
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.video.frames import planar_frames
from humanmm.models.video.reading import read_facts

EXAMPLES = Path(__file__).parents[4] / "examples" / "pose2sim_multishot"
TIME_S = np.arange(100) / 60
SPAN, SIZE = (36, 41), (720, 1280)


@lru_cache(maxsize=1)
def pictures() -> tuple[tuple[int, Picture], ...]:
    def decoded() -> Iterator[tuple[int, Picture]]:
        with (EXAMPLES / "pose2sim_A_01-02-01.mp4").open("rb") as stream:
            for frame in planar_frames(stream, read_facts(stream), *SPAN):
                yield frame.index, Picture(frame.planes, frame.colors)

    return tuple(decoded())


@lru_cache(maxsize=1)
def boxes() -> np.ndarray:
    """(5, 4) xyxy of the man."""
    with np.load(EXAMPLES / "pose2sim_A_01-02-01_gt.npz") as truth:
        points = truth["openpose2d"][slice(*SPAN), :, :2]
    low, high = np.nanmin(points, axis=1), np.nanmax(points, axis=1)
    return np.concatenate([low, high], axis=1) + np.array([-15, -40, 15, 15])


def given(person: int = 7) -> GivenRegions:
    """The man, and a box in which nobody is."""
    frame = np.repeat(np.arange(*SPAN), 2)
    empty = np.tile([20.0, 700, 90, 800], (len(boxes()), 1))
    box = np.stack([boxes(), empty], axis=1).reshape(-1, 4)
    who = np.tile([person, person + 1 if person >= 0 else -1], len(boxes()))
    return GivenRegions(frame, who, box, np.full(len(frame), 0.9))


def _tracked(regions: GivenRegions) -> ScenePeople:
    return track_regions(
        pictures(), regions, span=SPAN, time_s=TIME_S, size=SIZE, max_people=3, networks=replace(QUICK)
    )


def test_whoever_fills_a_box_is_followed_and_nobody_is_found_in_an_empty_one() -> None:
    for regions in (given(), given(-1)):
        (track,) = _tracked(regions).tracks
        np.testing.assert_array_equal(track.frame, np.arange(*SPAN))
        assert (box_iou(track.bbox, boxes()) > 0.6).all()
        hips = track.keypoints2d[:, list(landmarks.HIPS), :2].mean(axis=1)
        assert ((hips > boxes()[:, :2]) & (hips < boxes()[:, 2:])).all()
        assert len(track.color_frame) > 0 and track.probability > 0.5


@pytest.mark.parametrize("masks", [False, True])
def test_between_boxes_of_one_person_he_is_looked_for_on_a_straight_line(masks: bool) -> None:
    whole = given()
    rows = np.isin(whole.frame, (SPAN[0], SPAN[1] - 1))  # the first frame and the last
    few = replace(
        whole, frame=whole.frame[rows], person=whole.person[rows], box=whole.box[rows], score=whole.score[rows],
        labels=(lambda frame: _box_as_mask(frame) if frame in (SPAN[0], SPAN[1] - 1) else None) if masks else None,
    )  # fmt: skip
    (track,) = _tracked(few).tracks
    np.testing.assert_array_equal(track.frame, np.arange(*SPAN))
    assert (box_iou(track.bbox, boxes()) > 0.6).all()


def test_boxes_are_filled_in_for_half_a_second_and_each_owner_has_his_own() -> None:
    frame = np.array([0, 2, 4, 40])  # one of number 5 in frames 0, 4 and 40, one of 9 in frame 2
    box = np.array([[0.0, 0, 10, 20], [50, 0, 60, 20], [8, 4, 18, 24], [8, 4, 18, 24]])
    found = GivenRegions(frame, np.array([5, 9, 5, 5]), box, np.ones(4))
    filled, owner = _filled(found, np.arange(4), np.array([0, 1, 0, 0]), TIME_S)
    assert filled.frame.tolist() == [0, 1, 2, 2, 3, 4, 40], "frame 40 is 0.6 s later"
    assert owner.tolist() == [0, 0, 1, 0, 0, 0, 0] and filled.person.tolist() == [5, 5, 9, 5, 5, 5, 5]
    np.testing.assert_allclose(filled.box[[1, 3, 4]], [[2, 1, 12, 21], [4, 2, 14, 22], [6, 3, 16, 23]])
    assert len(_filled(found, np.arange(0), np.zeros(0, int), TIME_S)[1]) == 0


def test_boxes_on_few_frames_have_a_warning() -> None:
    time_s = np.arange(300) / 30
    assert sparse(np.arange(0, 300, 3), time_s) == sparse(np.array([7, 7]), time_s) == ()
    (said,) = sparse(np.repeat(np.arange(0, 300, 5), 2), time_s)
    assert "on one frame in 5 (0.17 s apart)" in said and "straight line" in said
    (said,) = sparse(np.arange(0, 300, 30), time_s)
    assert "on one frame in 30 (1.00 s apart): nobody is looked for between" in said


def _box_as_mask(frame: int) -> np.ndarray:
    """The man's box as a mask of half the video's size."""
    picture = np.zeros((SIZE[1] // 2, SIZE[0] // 2), np.int32)
    x0, y0, x1, y1 = (boxes()[frame - SPAN[0]] / 2).astype(int)
    picture[y0:y1, x0:x1] = 7
    return picture


def test_whoever_has_a_number_keeps_it_beside_boxes_without_one() -> None:
    regions = given()
    (numbered,) = _tracked(regions).tracks
    mixed = np.where(regions.person == 7, 7, -1)
    (track,) = _tracked(replace(regions, person=mixed)).tracks
    np.testing.assert_array_equal(track.bbox, numbered.bbox)
    swapped = np.where(regions.person == 7, -1, 7)
    (track,) = _tracked(replace(regions, person=swapped)).tracks
    np.testing.assert_array_equal(track.frame, np.arange(*SPAN))


def test_only_numbers_that_name_people_through_the_whole_video_leave_the_scene() -> None:
    for regions, number in ((given(), -1), (replace(given(), lasting=True), 7), (replace(given(-1), lasting=True), -1)):
        (track,) = _tracked(regions).tracks
        assert track.number == number


def test_of_more_people_than_wanted_at_a_time_the_smaller_are_left_out_and_reported() -> None:
    scene = track_regions(
        pictures(), given(), span=SPAN, time_s=TIME_S, size=SIZE, max_people=1, networks=replace(QUICK)
    )
    assert len(scene.tracks) == 1
    (left,) = scene.unfollowed
    assert left.crowded and (left.first, left.last) == (SPAN[0], SPAN[1] - 1)
    np.testing.assert_allclose(left.box, (20, 700, 90, 800), atol=1e-6)


def test_what_is_odd_about_regions_is_told() -> None:
    assert _tracked(replace(given(), warnings=("odd",))).warnings == ("odd",)


def test_a_given_mask_takes_the_place_of_the_networks_own() -> None:
    (track,) = _tracked(replace(given(), labels=_box_as_mask)).tracks
    rows, columns = np.nonzero(track.masks.mask(3))
    pixels = np.column_stack([columns, rows]) + 0.5
    pixels = pixels @ track.mask_affine[3, :, :2].T + track.mask_affine[3, :, 2]
    found = np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])
    assert box_iou(found, boxes()[3]) > 0.9, "the whole box is the mask"


BOTH = np.array([[40.0, 30, 110, 190], [82.0, 20, 152, 180]])
"""Boxes of two people; the first stands before the second."""


def _standing(box: np.ndarray) -> np.ndarray:
    """(33, 3) keypoints of somebody upright who fills a box, all seen."""
    middle, height = box[[0, 2]].mean(), box[3] - box[1]
    keypoints = np.column_stack([np.full(33, middle), np.full(33, box[1] + 0.1 * height), np.ones(33)])
    for name, y, width in (
        ("shoulder", 0.2, 15), ("elbow", 0.35, 35), ("wrist", 0.5, 35), ("hip", 0.5, 12), ("knee", 0.75, 12),
        ("ankle", 1.0, 12),
    ):  # fmt: skip
        for side, sign in (("left", 1), ("right", -1)):
            keypoints[landmarks.INDEX[f"{side}_{name}"], :2] = middle + sign * width, box[1] + y * height
    return keypoints


def _sees_the_front_one(image: Picture, region: Region, *, mirrored: bool = False) -> Landmarks:
    """Of the two, the first as long as he is not painted out in the middle of his chest."""
    box = BOTH[int(image.planes[0][80, 60] > 20)]
    there = Region(float(box[[0, 2]].mean()), float(box[[1, 3]].mean()), 250.0)
    columns, rows = np.meshgrid(*[(np.arange(128) + 0.5) / 128 * there.side - there.side / 2] * 2)
    own = (abs(columns) < 0.42 * (box[2] - box[0])) & (abs(rows) < (box[3] - box[1]) / 2)
    points = _standing(box)
    in_space = np.column_stack([points[:, :2] - (there.x, there.y), np.zeros(33)]) / 100
    return Landmarks(points, in_space, 1.0, own.astype(np.uint8) * 255, there, there)


@pytest.mark.parametrize("masks", [False, True])
def test_whoever_is_in_front_is_not_taken_for_the_one_behind_him(masks: bool) -> None:
    def black() -> list[tuple[int, Picture]]:
        chroma = np.full((100, 100), 128, np.uint8)
        return [(k, Picture((np.full((200, 200), 16, np.uint8), chroma, chroma))) for k in range(3)]

    def labels(frame: int) -> np.ndarray:
        picture = np.zeros((200, 200), np.int32)
        picture[20:180, 82:152] = 2
        picture[30:190, 40:110] = 1
        return picture

    given = GivenRegions(
        np.repeat(np.arange(3), 2), np.tile([2, 1], 3), np.tile(BOTH[::-1], (3, 1)), np.ones(6),
        labels if masks else None,
    )  # fmt: skip

    def middles(locate: PoseNetwork) -> list[list[float]]:
        """Of the people found, frame by frame."""
        found = track_regions(
            black(), given, span=(0, 3), time_s=np.arange(3) / 10, size=(200, 200), max_people=3,
            networks=Networks(QUICK.detect, locate),
        )  # fmt: skip
        return sorted(one.keypoints2d[:, landmarks.INDEX["nose"], 0].tolist() for one in found.tracks)

    assert middles(_sees_the_front_one) == [[75.0] * 3, [117.0] * 3]
    deceived = middles(lambda image, region, mirrored=False: _sees_the_front_one(black()[0][1], region))
    assert deceived == [[75.0] * 3]


def test_boxes_without_numbers_are_linked_by_overlap_until_a_second_has_passed() -> None:
    frame = np.array([0, 0, 1, 1, 2, 90, 91])
    left, right = [10.0, 10, 60, 110], [200.0, 10, 260, 110]
    box = np.array([left, right, right, left, left, left, right])
    found = GivenRegions(frame, np.full(7, -1), box, np.ones(7))
    assert _owners(found, np.arange(7), TIME_S).tolist() == [0, 1, 1, 0, 0, 2, 3]
    numbered = replace(found, person=np.array([5, 9, 9, 5, 5, 5, 9]))
    assert _owners(numbered, np.arange(7), TIME_S).tolist() == [0, 1, 1, 0, 0, 0, 1]
