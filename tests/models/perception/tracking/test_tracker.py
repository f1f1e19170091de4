"""Finding and following people in real pixels (the shipped clip) and in none."""

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from quick_networks import QUICK

from humanmm.models.perception.interfaces import Detection, Landmarks, Networks
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import Region
from humanmm.models.perception.tracking.tracker import search_due, track_pictures
from humanmm.models.records import landmarks
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.video.frames import planar_frames
from humanmm.models.video.reading import read_facts

EXAMPLES = Path(__file__).parents[4] / "examples" / "pose2sim_multishot"
CLIP = EXAMPLES / "pose2sim_A_01-02-01.mp4"
TIME_S = np.arange(100) / 60
SCENE = (36, 50)
"""Frames in which the man leans by 40°: the network alone swaps left and right in half of them."""


@lru_cache(maxsize=1)
def pictures() -> tuple[tuple[int, Picture], ...]:
    def decoded() -> Iterator[tuple[int, Picture]]:
        with CLIP.open("rb") as stream:
            for frame in planar_frames(stream, read_facts(stream), *SCENE):
                yield frame.index, Picture(frame.planes, frame.colors)

    return tuple(decoded())


def _of_planes(image: Picture, rows: slice, columns: slice) -> Picture:
    """A part of a picture, or every other of its pixels."""
    y, cb, cr = image.planes
    half_rows, half_columns = (
        part if part.start is None else slice(part.start // 2, part.stop // 2) for part in (rows, columns)
    )
    return Picture(
        (y[rows, columns].copy(), cb[half_rows, half_columns].copy(), cr[half_rows, half_columns].copy()), image.colors
    )


@lru_cache(maxsize=1)
def scene() -> ScenePeople:
    return track_pictures(pictures(), start=SCENE[0], end=SCENE[1], time_s=TIME_S, size=(720, 1280), max_people=3)


def test_everybody_is_looked_for_every_third_of_a_second_and_more_often_in_a_short_scene() -> None:
    assert np.flatnonzero(search_due(np.arange(61) / 30)).tolist() == [0, 10, 20, 30, 40, 50, 60]
    assert np.flatnonzero(search_due(np.arange(16) / 25)).tolist() == [0, 4, 8, 12, 15]
    assert search_due(np.array([0.4])).tolist() == [True]


def test_the_main_person_is_followed_through_every_frame() -> None:
    track = scene().tracks[0]
    np.testing.assert_array_equal(track.frame, np.arange(*SCENE))
    assert np.median(track.confidence) > 0.6


def test_limbs_lie_where_an_independent_detector_sees_them_with_left_and_right_as_there() -> None:
    with np.load(EXAMPLES / "pose2sim_A_01-02-01_gt.npz") as truth:
        names = [str(name) for name in truth["joint_names"]]
        openpose = truth["openpose2d"]
    track = scene().tracks[0]
    for joint in ("Shoulder", "Hip", "Knee", "Ankle"):
        for side in ("left", "right"):
            ours = track.keypoints2d[:, landmarks.INDEX[f"{side}_{joint.lower()}"], :2]
            theirs = openpose[track.frame, names.index(f"{side[0].upper()}{joint}"), :2] + 0.5
            # 25 px are 4 % of the man's height: joint definitions differ by that much, left and right by 40 px.
            assert np.median(np.linalg.norm(ours - theirs, axis=1)) < 25, (side, joint)


def test_masks_lie_inside_the_boxes_and_cover_the_body() -> None:
    track = scene().tracks[0]
    assert len(track.masks.end) == len(track.frame)
    rows, columns = np.nonzero(track.masks.mask(0))
    pixels = np.column_stack([columns, rows]) + 0.5
    pixels = pixels @ track.mask_affine[0, :, :2].T + track.mask_affine[0, :, 2]
    x0, y0, x1, y1 = track.bbox[0]
    within = (pixels[:, 0] > x0 - 1) & (pixels[:, 0] < x1 + 1) & (pixels[:, 1] > y0 - 1) & (pixels[:, 1] < y1 + 1)
    assert within.mean() > 0.98
    assert 0.2 < len(rows) * abs(np.linalg.det(track.mask_affine[0, :, :2])) / ((x1 - x0) * (y1 - y0)) < 0.9


def test_reduced_pictures_give_the_same_places_in_source_pixels() -> None:
    reduced = [
        (index, _of_planes(image, slice(None, None, 2), slice(None, None, 2))) for index, image in pictures()[:2]
    ]
    small = track_pictures(
        reduced, start=36, end=38, time_s=TIME_S, size=(720, 1280), max_people=1, networks=QUICK
    ).tracks[0]
    limbs = list(landmarks.LIMBS)
    distance = np.linalg.norm(small.keypoints2d[0, limbs, :2] - scene().tracks[0].keypoints2d[0, limbs, :2], axis=-1)
    assert np.median(distance) < 10  # 1.5 % of the man's height


def test_the_same_frames_give_the_same_tracks_again() -> None:
    few = pictures()[:2]
    one, two = (
        track_pictures(few, start=36, end=38, time_s=TIME_S, size=(720, 1280), max_people=2, networks=QUICK).tracks[0]
        for _ in range(2)
    )
    np.testing.assert_array_equal(one.keypoints2d, two.keypoints2d)
    np.testing.assert_array_equal(one.masks.data, two.masks.data)


@pytest.mark.parametrize("value", [16, 125, 235])
def test_nobody_is_found_in_an_empty_picture(value: int) -> None:
    chroma = np.full((120, 160), 128, np.uint8)
    empty = [(index, Picture((np.full((240, 320), value, np.uint8), chroma, chroma))) for index in range(3)]
    assert (
        track_pictures(
            empty, start=0, end=3, time_s=np.arange(3) / 30, size=(320, 240), max_people=4, networks=QUICK
        ).tracks
        == ()
    )


def test_a_close_up_without_hips_is_nobody() -> None:
    face = [(index, _of_planes(image, slice(300, 420), slice(300, 480))) for index, image in pictures()[:3]]
    assert (
        track_pictures(face, start=36, end=39, time_s=TIME_S, size=(180, 120), max_people=4, networks=QUICK).tracks
        == ()
    )


def body(x: float, *, hips: float) -> np.ndarray:
    """(33, 3) keypoints of somebody upright whose head is 40 px below the upper edge."""
    keypoints = np.column_stack([np.full(33, x), np.full(33, 40.0), np.ones(33)])
    for name, y, width in (
        ("shoulder", 70.0, 20), ("elbow", 95.0, 22), ("wrist", 110.0, 20), ("hip", hips, 12), ("knee", hips + 45, 12),
        ("ankle", hips + 90, 12),
    ):  # fmt: skip
        for side, sign in (("left", 1), ("right", -1)):
            keypoints[landmarks.INDEX[f"{side}_{name}"], :2] = x + sign * width, y
    return keypoints


@pytest.mark.parametrize(
    ("hips", "slid", "frames"), [(130.0, 70.0, 3), (110.0, 30.0, 6)], ids=["head and shoulders", "whole"]
)
def test_a_crop_of_head_and_shoulders_that_slides_to_somebody_else_is_not_followed(
    hips: float, slid: float, frames: int
) -> None:
    """The crop of a whole person may, unless it leaps: it hangs on what is seen, and a new search says who is there."""
    left, right, height = body(100, hips=hips), body(100 + slid, hips=hips), 120 if hips > 120 else 240
    chroma = np.full((height // 2, 160), 128, np.uint8)
    picture = Picture((np.full((height, 320), 60, np.uint8), chroma, chroma.copy()))
    looked = 0

    def locate(_: Picture, region: Region, *, mirrored: bool = False) -> Landmarks:
        nonlocal looked
        looked += not mirrored
        shown = right if looked > 5 else left
        there = Region(float(shown[0, 0]), hips, 200.0)
        in_space = (shown - [shown[0, 0], hips, 1.0]) / 110
        return Landmarks(shown, in_space, 1.0, np.full((128, 128), 255, np.uint8), region, there)

    coco = left[list(landmarks.COCO_LANDMARKS)]
    seen = Detection(0.6, Region(100, hips, 200.0), np.array([70.0, 20, 130, height]), coco)
    people = track_pictures(
        ((k, picture) for k in range(6)), start=0, end=6, time_s=np.arange(6) / 30, size=(320, height), max_people=1,
        networks=Networks(lambda *_: [seen], locate),
    )  # fmt: skip
    (track,) = people.tracks
    assert len(track.frame) == frames
    x = track.keypoints2d[:, 0, 0]
    assert (np.ptp(x) == 0) == (hips > 120)


@pytest.mark.parametrize(("back", "people"), [(12, 1), (60, 2)], ids=["hidden for a moment", "gone"])
def test_nobody_takes_the_place_of_who_is_hidden_for_a_moment(back: int, people: int) -> None:
    """One person may be followed: he is not seen from frame 8 on, and somebody else stands there when people are looked
    for in frame 10 and later."""
    one, other, coco = body(70, hips=110), body(500, hips=110), list(landmarks.COCO_LANDMARKS)
    chroma = np.full((120, 320), 128, np.uint8)
    picture, frame = Picture((np.full((240, 640), 60, np.uint8), chroma, chroma.copy())), -1

    def pictures() -> Iterator[tuple[int, Picture]]:
        nonlocal frame
        for frame in range(40):
            yield frame, picture

    def shown() -> list[np.ndarray]:
        return [other] if 8 <= frame < back else [one, other] if frame >= back else [one]

    def locate(_: Picture, region: Region, *, mirrored: bool = False) -> Landmarks:
        there = min(shown(), key=lambda keypoints: abs(keypoints[0, 0] - region.x))
        presence = float(abs(there[0, 0] - region.x) < 60)
        own = Region(float(there[0, 0]), 110.0, 200.0)
        in_space = (there - [there[0, 0], 110.0, 1.0]) / 110
        mask = np.full((128, 128), round(255 * presence), np.uint8)
        return Landmarks(there, in_space, presence, mask, region, own)

    def detect(*_: object) -> list[Detection]:
        return [
            Detection(0.6, Region(x, 110, 200.0), np.array([x - 30, 20, x + 30, 210]), who[coco])
            for who in shown()
            for x in (float(who[0, 0]),)
        ]

    tracks = track_pictures(
        pictures(), start=0, end=40, time_s=np.arange(40) / 30, size=(640, 240), max_people=1,
        networks=Networks(detect, locate),
    ).tracks  # fmt: skip
    assert len(tracks) == people
    assert not any(set(a.frame.tolist()) & set(b.frame.tolist()) for a in tracks for b in tracks if a is not b)
