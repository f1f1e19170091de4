"""Dissolves and fades that are linear in time, at irregular times."""

import cv2
import numpy as np
import pytest
from places import HEIGHT, WIDTH, Place

from humanmm.models.geometry.intervals import Interval
from humanmm.models.shot_detection.gradual import (
    BlendDetail,
    dips,
    dissolves,
    explained_detail,
    fade_around,
    meeting_blends,
    most_frames,
    uniform_runs,
)
from humanmm.models.shot_detection.picture_window import PictureWindow
from humanmm.models.shot_detection.scenes import find_scenes

STEPS_S = np.random.default_rng(1).choice([0.02, 0.03, 0.08], 110)
TIME_S = np.cumsum(STEPS_S)
MEAN_RATE_TIME_S = np.arange(110) * STEPS_S.mean()


def blended(before: np.ndarray, after: np.ndarray, weight: float) -> np.ndarray:
    return cv2.addWeighted(before, 1 - weight, after, weight, 0)


def detail_of(window: PictureWindow, before: int, after: int) -> BlendDetail:
    return BlendDetail.of(window, before, after, np.ones(window.end))


def changes(pictures: list[np.ndarray], time_s: np.ndarray) -> list[tuple[str, int, int]]:
    return [(t.type, t.start, t.end) for t in find_scenes(pictures, time_s).transitions]


def test_a_dissolve_is_linear_in_time_not_in_frames() -> None:
    one, two = Place(1).picture(0), Place(2).picture(0)
    weights = np.clip((TIME_S - TIME_S[40]) / 0.8, 0, 1)
    inside = np.flatnonzero((weights > 0) & (weights < 1))
    pictures = [blended(one, two, w) for w in weights]
    ((kind, start, end),) = changes(pictures, TIME_S)
    assert kind == "dissolve"
    assert abs(start - inside[0]) <= 1 and abs(end - inside[-1] - 1) <= 1
    # as if frames were evenly apart, the blend is no straight ramp: it is missed, or its frames are wrong
    wrong = changes(pictures, MEAN_RATE_TIME_S)
    assert wrong != [(kind, start, end)]


def test_lamps_that_flicker_hide_no_dissolve() -> None:
    one, two = Place(1).picture(0), Place(2).picture(0)
    time_s = np.arange(110) / 30
    weights = np.clip((np.arange(110) - 39) / 20, 0, 1)
    light = 1 + 0.18 * np.sin(2 * np.pi * 0.31 * np.arange(110))
    pictures = [
        np.clip(blended(one, two, w) * by, 0, 255).astype(np.uint8) for w, by in zip(weights, light, strict=True)
    ]
    ((kind, start, end),) = changes(pictures, time_s)
    assert kind == "dissolve"
    assert abs(start - 40) <= 2 and abs(end - 59) <= 2


@pytest.mark.parametrize("seconds", [0.6, 1.5])
def test_a_fade_reaches_as_far_as_its_light_changes_linearly_in_time(seconds: float) -> None:
    out_s, in_s = TIME_S[50], TIME_S[70]
    light = np.clip(np.maximum((out_s - TIME_S) / seconds, (TIME_S - in_s) / seconds), 0, 1)
    contrast = 40 * light
    (run,) = uniform_runs((contrast < 4).tolist())
    found = fade_around(contrast.tolist(), run, TIME_S)
    inside = np.flatnonzero(light < 1)
    assert abs(found.start - inside[0]) <= 1 and abs(found.end - inside[-1] - 1) <= 1


def test_uniform_runs_touch_neither_end() -> None:
    assert uniform_runs([True, True, False, True, True, False, True, False, True]) == [(3, 5), (6, 7)]


def test_the_most_frames_in_a_duration_are_those_where_frames_are_densest() -> None:
    assert most_frames(np.arange(300) / 30, 2.0) == 60
    assert most_frames(np.r_[np.arange(10) * 0.5, 5 + np.arange(20) * 0.05], 0.5) == 10


def test_blends_that_meet_in_a_dim_picture_are_a_fade_and_others_one_dissolve() -> None:
    contrast = np.full(60, 40.0)
    contrast[18:22] = 8.0
    blends = [Interval(10, 20), Interval(21, 30), Interval(40, 44), Interval(45, 50), Interval(55, 58)]
    bright, dim = meeting_blends(contrast.tolist(), blends)
    assert dim == [(10, 30)]
    assert bright == [(40, 50), (55, 58)]


def test_a_uniform_picture_for_a_moment_between_two_views_of_one_place_is_no_fade_in_seconds() -> None:
    pictures = Place(7).still(40)
    for frame in range(20, 25):
        pictures[frame] = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    # five frames: 0.17 s at 30 Hz are a blink, 1 s at 5 Hz are a fade
    assert changes(pictures, np.arange(40) / 30) == []
    assert [kind for kind, _, _ in changes(pictures, np.arange(40) / 5)] == ["fade"]


def test_a_pan_keeps_its_detail_however_little_its_ends_have_in_common() -> None:
    place = Place(3)
    window = PictureWindow(np.arange(60) / 30)
    for frame in range(60):
        window.append(place.picture(0, offset=(0.7 * WIDTH * frame / 59, 0)))
    assert detail_of(window, 0, 59).lost < 0.15
    assert detail_of(window, 0, 12).lost < 0.15


@pytest.mark.parametrize("frames", [3, 20])
def test_a_dissolve_between_two_places_loses_detail(frames: int) -> None:
    one, two = Place(1), Place(2)
    window = PictureWindow(np.arange(frames) / 30)
    for frame in range(frames):
        window.append(blended(one.picture(frame), two.picture(frame), frame / (frames - 1)))
    detail = detail_of(window, 0, frames - 1)
    assert detail.lost == pytest.approx(1, abs=0.25)
    assert detail.error < 0.1
    assert explained_detail(window, 0, frames - 1) > 0.9


@pytest.mark.parametrize("step_px", [10.0, 40.0])
def test_a_sweep_loses_detail_otherwise_than_a_blend_of_its_ends(step_px: float) -> None:
    place, window = Place(3), PictureWindow(np.arange(5) / 30)
    for frame in range(5):
        blur = (1 + 20 * (frame in (1, 2, 3)), 1)
        window.append(cv2.blur(place.picture(0, offset=(step_px * frame, 0)), blur))
    detail = detail_of(window, 0, 4)
    assert detail.lost > 0.3
    assert detail.error > 0.19
    assert explained_detail(window, 0, 4) < 0.4


def test_two_dissolves_half_a_second_apart_are_not_one() -> None:
    one, two, three = Place(1), Place(2), Place(4)
    weights = np.clip((np.arange(90)[:, None] - (19, 47)) / (14, 20), 0, 1)
    window = PictureWindow(np.arange(90) / 30)
    for frame, (second, third) in enumerate(weights):
        earlier = blended(one.picture(frame), two.picture(frame), second)
        window.append(blended(earlier, three.picture(frame), third))
    assert detail_of(window, 15, 70).error > 0.19
    spans = [(found.start, found.end) for found in dissolves(window, 0, 90, 60)]
    assert np.allclose(spans, [(20, 33), (48, 67)], atol=2)


def dipped(pictures: list[np.ndarray], middle: int, num_frames: int) -> list[np.ndarray]:
    """Darkened towards two frames in the middle, which keep a little of their light."""
    light = [np.clip(0.1 + 0.9 * abs(k + 0.5 - middle) / num_frames, 0, 1) for k in range(len(pictures))]
    return [(picture * one).astype(np.uint8) for picture, one in zip(pictures, light, strict=True)]


def test_a_fade_of_a_camera_that_turns_may_be_too_short_for_a_black_frame() -> None:
    places = [Place(1)] * 40 + [Place(2)] * 40
    film = dipped([place.picture(k, (8.0 * k, 0)) for k, place in enumerate(places)], 40, 6)
    ((kind, start, end),) = changes(film, np.arange(80) / 30)
    assert kind == "fade" and abs(start - 34) <= 2 and abs(end - 46) <= 2


def test_the_contrast_that_falls_at_once_is_no_fade() -> None:
    contrast = np.full(60, 50.0)
    contrast[30:33] = 5.0
    assert dips(contrast.tolist(), np.arange(60) / 30) == []
    contrast[24:30], contrast[33:39] = np.linspace(45, 10, 6), np.linspace(10, 45, 6)
    ((start, end),) = dips(contrast.tolist(), np.arange(60) / 30)
    assert start <= 25 and end >= 38
