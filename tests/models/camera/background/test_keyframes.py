"""Key frames stand for a shot, and the features on its people are left out."""

from dataclasses import fields

import numpy as np

from humanmm.models.camera.background.frame_edges import match_features
from humanmm.models.camera.background.keyframes import FrameFeatures, key_frames, only_background
from humanmm.models.records.shots import Shot, Transition
from humanmm.models.records.tracks import PersonTrack

BOX = (100.0, 100.0, 200.0, 300.0)


def features(frame: int) -> FrameFeatures:
    """Features all over a picture of 640 x 480, each unlike the others."""
    random = np.random.default_rng(4)
    xy = random.uniform([0, 0], [640, 480], (500, 2)).astype(np.float32)
    descriptors = random.integers(0, 256, (500, 128)).astype(np.uint8)
    segments = np.array([[150, 150, 160, 290], [300, 20, 310, 400]], np.float32)  # the first on the person
    return FrameFeatures(frame, xy, descriptors, segments)


def person(frame: int) -> PersonTrack:
    """Somebody seen in one frame."""
    blank = {field.name: np.zeros(0) for field in fields(PersonTrack)}
    return PersonTrack(**blank | {"frame": np.array([frame]), "bbox": np.array([BOX]), "lifted": False})  # type: ignore[arg-type]


def test_features_on_people_take_no_part() -> None:
    everything = features(5)
    kept = only_background(everything, [person(9)])
    x0, y0, x1, y1 = BOX
    low, high = np.array([x0 - 10, y0 - 20]), np.array([x1 + 10, y1 + 20])  # widened by a tenth
    outside = ((everything.xy <= low) | (everything.xy >= high)).any(axis=1)
    np.testing.assert_array_equal(kept.xy, everything.xy[outside])
    assert 0 < len(kept.xy) < len(everything.xy)
    _, index = match_features(kept.roots, everything.roots)
    assert outside[index].all()
    np.testing.assert_array_equal(kept.segments, everything.segments[1:])


def test_features_on_what_is_burned_in_take_no_part() -> None:
    everything = features(5)
    kept = only_background(everything, [], [(0.0, 0.0, 640.0, 100.0), BOX])
    inside = ((everything.xy > BOX[:2]) & (everything.xy < BOX[2:])).all(axis=1)
    np.testing.assert_array_equal(kept.xy, everything.xy[~inside & (everything.xy[:, 1] >= 100)])
    np.testing.assert_array_equal(kept.segments, everything.segments[1:])


def test_a_box_of_long_ago_hides_nothing() -> None:
    assert len(only_background(features(50), [person(9)]).xy) == 500


def test_first_middle_and_last_clear_frame_stand_for_a_shot() -> None:
    dissolve, cut = Transition("dissolve", 15, 25, "scene"), Transition("cut", 60, 60, "scene")
    assert key_frames(Shot(0, 0, 100, 0, None, ())) == (0, 50, 99)
    assert key_frames(Shot(1, 20, 60, 0, dissolve, (), cut)) == (25, 42, 59)
    assert key_frames(Shot(0, 0, 20, 0, None, (), dissolve)) == (0, 7, 14)
    assert key_frames(Shot(1, 7, 8, 0, None, ())) == (7,)


def test_a_shot_without_a_clear_frame_has_no_key_frame() -> None:
    dissolves = [Transition("dissolve", middle - 8, middle + 8, "scene") for middle in (20, 30)]
    assert key_frames(Shot(1, 20, 30, 0, dissolves[0], (), dissolves[1])) == ()
