"""Shot changes are found where they are, and nowhere else: on made-up pictures and on real clips."""

import json
import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from places import HEIGHT, WIDTH, Place
from scenedetect import FrameTimecode
from scenedetect.detectors import AdaptiveDetector, ContentDetector

from humanmm.models.records.shots import Scenes
from humanmm.models.shot_detection import scenes
from humanmm.models.shot_detection.picture_window import SIDE_PX, PictureWindow
from humanmm.models.shot_detection.scenes import find_scenes, proposals
from humanmm.models.video.frames import frames
from humanmm.models.video.reading import read_facts

DATA = os.environ.get("HUMANMM_DATA")
EXAMPLE = Path(__file__).parents[3] / "examples/pose2sim_multishot/pose2sim_A_01-02-01.mp4"
needs_data = pytest.mark.skipif(DATA is None, reason="HUMANMM_DATA names no folder with the development clips")


def dissolved(before: list[np.ndarray], after: list[np.ndarray], length: int) -> list[np.ndarray]:
    """The end of one shot blended into the beginning of the next; the first blended frame is len(before) - length."""
    weights = (np.arange(length) + 1) / (length + 1)
    blend = [
        cv2.addWeighted(a, 1 - w, b, w, 0) for a, b, w in zip(before[-length:], after[:length], weights, strict=True)
    ]
    return before[:-length] + blend + after[length:]


def at_25_hz(film: list[np.ndarray]) -> np.ndarray:
    return np.arange(len(film)) / 25


def changes(scenes: Scenes) -> list[tuple[str, int, int]]:
    return [(t.type, t.start, t.end) for t in scenes.transitions]


def test_hard_cuts_are_found_at_the_first_new_frame() -> None:
    film = Place(1).still(20) + Place(2).still(31) + Place(3).still(12)
    assert changes(find_scenes(film, at_25_hz(film))) == [("cut", 20, 20), ("cut", 51, 51)]


def test_cuts_two_frames_apart_are_all_found() -> None:
    film = Place(1).still(20) + Place(2).still(2) + Place(3).still(2) + Place(4).still(20)
    assert changes(find_scenes(film, at_25_hz(film))) == [("cut", 20, 20), ("cut", 22, 22), ("cut", 24, 24)]


def test_a_jump_inside_one_place_is_a_cut_though_everything_is_seen_again() -> None:
    place = Place(5)
    film = place.still(25) + [place.picture(t, (30, 4)) for t in range(25)]
    assert changes(find_scenes(film, at_25_hz(film))) == [("cut", 25, 25)]


@pytest.mark.parametrize("length", [5, 12, 24])
def test_a_dissolve_is_one_transition_with_its_first_and_last_frame(length: int) -> None:
    film = dissolved(Place(1).still(60), Place(2).still(60), length)
    ((kind, start, end),) = changes(find_scenes(film, at_25_hz(film)))
    assert kind == "dissolve"
    assert abs(start - (60 - length)) <= 2
    assert abs(end - 60) <= 2


@pytest.mark.parametrize("level", [0, 255])
def test_a_fade_through_black_or_white_is_one_transition(level: int) -> None:
    plain = [np.full((HEIGHT, WIDTH, 3), level, np.uint8)] * 30
    film = dissolved(dissolved(Place(1).still(50), plain[:24], 10), Place(2).still(50), 10)
    (fade,) = find_scenes(film, at_25_hz(film)).transitions
    assert fade.type == "fade"
    assert abs(fade.start - 40) <= 2
    assert abs(fade.end - 64) <= 2
    assert abs(fade.clear_until - 45) <= 1 and abs(fade.clear_from - 59) <= 1, "as long as half the light is left"


def test_a_shaking_camera_makes_no_cut() -> None:
    place, generator = Place(7), np.random.default_rng(7)
    path = np.cumsum(generator.normal(0, 5, (60, 2)), axis=0)
    film = place.still(20) + [place.picture(t, tuple(path[t])) for t in range(60)]
    assert changes(find_scenes(film, at_25_hz(film))) == []


def test_a_whip_pan_makes_no_cut() -> None:
    place = Place(8)
    ease = (1 - np.cos(np.linspace(0, np.pi, 9))) / 2 * 1.5 * WIDTH
    speed = np.gradient(ease) / 2
    pan = [place.picture(t, (float(x), 0), blur=float(v)) for t, (x, v) in enumerate(zip(ease, speed, strict=True))]
    film = place.still(25) + pan + [place.picture(t, (float(ease[-1]), 0)) for t in range(25)]
    assert changes(find_scenes(film, at_25_hz(film))) == []


def test_flashes_and_exposure_steps_make_no_cut() -> None:
    film = Place(9).still(80)
    for frame, gain in ((20, 3.0), (21, 2.0), (50, 2.5)):
        film[frame] = np.clip(film[frame] * gain + 60, 0, 255).astype(np.uint8)
    film[60:] = [np.clip(picture * 0.6, 0, 255).astype(np.uint8) for picture in film[60:]]
    assert changes(find_scenes(film, at_25_hz(film))) == []


def test_cuts_are_proposed_where_pyscenedetect_proposes_them() -> None:
    generator = np.random.default_rng(3)
    levels = np.cumsum(generator.choice([0, 0, 1, 3, 9, 40, 80], 300) * generator.choice([-1, 1], 300)) % 255
    pictures = [np.full((18, 32, 3), level, np.uint8) for level in levels]
    adaptive = AdaptiveDetector(min_scene_len=1, min_content_val=3.0)
    content = ContentDetector(threshold=20.0, min_scene_len=1)
    window = PictureWindow(at_25_hz(pictures))
    proposed: set[int] = set()
    expected: set[int] = set()
    for frame, picture in enumerate(pictures):
        now = FrameTimecode(frame, 25.0)
        expected |= {t.frame_num for t in adaptive.process_frame(now, picture) + content.process_frame(now, picture)}
        window.append(picture)
        proposed |= set(proposals(window.change))
    assert len(expected) > 50
    assert proposed == expected


def test_what_is_found_does_not_depend_on_where_blocks_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scenes, "_BLOCK", 64)
    film = [picture for k in range(9) for picture in Place(20 + k).still(23)]
    assert [start for _, start, _ in changes(find_scenes(film, at_25_hz(film)))] == [23 * k for k in range(1, 9)]


def found_in(path: Path) -> Scenes:
    with path.open("rb") as stream:
        facts = read_facts(stream)
        return find_scenes((f.image for f in frames(stream, facts, pixels="bgr", max_side_px=SIDE_PX)), facts.time_s)


def test_the_shipped_clip_is_cut_twice() -> None:
    assert changes(found_in(EXAMPLE)) == [("cut", 36, 36), ("cut", 70, 70)]


@needs_data
def test_all_labelled_transitions_of_the_mixed_clip_are_found_and_no_other() -> None:
    truth = json.loads((Path(str(DATA)) / "videos/cutmix_dev.json").read_text())["transitions"]
    found = changes(found_in(Path(str(DATA)) / "videos/cutmix_dev.mp4"))
    assert [kind for kind, _, _ in found] == [t["type"] for t in truth]
    for (_, start, end), wanted in zip(found, truth, strict=True):
        assert abs(start - wanted["start"]) <= 2
        assert abs(end - wanted["end"]) <= 2


@needs_data
@pytest.mark.parametrize("name", ["mmaction2_demo.mp4", "mmaction2_structuralize.mp4"])
def test_violent_shake_pan_and_zoom_of_real_clips_make_no_cut(name: str) -> None:
    assert changes(found_in(Path(str(DATA)) / "videos" / name)) == []
