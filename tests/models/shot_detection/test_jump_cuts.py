"""Jump cuts: what moves jumps, and the place stays. Moving blobs of texture before a static textured wall."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from places import HEIGHT, WIDTH, Place, marbled

from humanmm.models.shot_detection.scenes import SceneDetector, find_scenes

FRAMES = 60
BLOB_PX = 36
RNG = np.random.default_rng(5)
BLOB = np.kron(RNG.integers(0, 255, (BLOB_PX // 4, BLOB_PX // 4, 3)), np.ones((4, 4, 1))).astype(np.uint8)


def film(left_px: Callable[[int], float], *, light: Callable[[int], int] = lambda _: 0) -> list[np.ndarray]:
    """A blob whose left edge is at `left_px` of each frame; `light` grey levels are added to the picture."""
    pictures = []
    for frame in range(FRAMES):
        picture = marbled(0.0).astype(np.int16)
        left = round(left_px(frame)) % (WIDTH - BLOB_PX)
        top = (HEIGHT - BLOB_PX) // 2
        picture[top : top + BLOB_PX, left : left + BLOB_PX] = BLOB
        pictures.append(np.clip(picture + light(frame), 0, 255).astype(np.uint8))
    return pictures


def cuts(pictures: list[np.ndarray], time_s: np.ndarray | None = None) -> list[int]:
    times = np.arange(FRAMES) / 30 if time_s is None else time_s
    return [transition.start for transition in find_scenes(pictures, times).transitions]


def after(frame: int, jump: float) -> Callable[[int], float]:
    """A slow walk that is a jump ahead from a frame on."""
    return lambda t: 20.0 + t + jump * (t >= frame)


def test_time_left_out_before_a_static_camera_is_a_cut() -> None:
    assert cuts(film(after(30, 60.0))) == [30]


def test_a_walk_without_a_jump_is_none() -> None:
    assert cuts(film(after(30, 0.0))) == []


def test_a_jump_among_jumps_is_none() -> None:
    """Somebody so fast is torn from place to place in every frame."""
    assert cuts(film(lambda t: 37.0 * t)) == []


def test_light_that_changes_where_somebody_walks_is_none() -> None:
    assert cuts(film(after(30, 0.0), light=lambda t: 40 * (t >= 30))) == []


def test_a_walk_while_the_recorder_repeats_a_picture_or_stalls_is_none() -> None:
    repeated = film(after(30, 0.0))
    repeated[22:30] = [repeated[22]] * 8
    assert cuts(repeated) == []
    time_s = (np.arange(FRAMES) + 40 * (np.arange(FRAMES) >= 30)) / 30
    assert cuts(film(after(30, 40.0)), time_s) == []


def test_somebody_else_in_the_place_of_somebody_who_hardly_moves_is_a_cut() -> None:
    """Pictures on both sides repeat because nothing moves, not because a recorder stalls."""
    assert cuts(film(lambda t: 20.0 + 60.0 * (t >= 30) + (t == 27) + (t == 33))) == [30]


def test_somebody_else_in_the_place_of_somebody_who_does_not_move_at_all_is_a_cut() -> None:
    """Nothing moves on either side, but what is replaced is higher than letters."""
    assert cuts(film(lambda t: 20.0 + 60.0 * (t >= 30))) == [30]


def test_a_subtitle_that_changes_is_none() -> None:
    """What is replaced where nothing moves before or after was drawn."""
    pictures = film(after(30, 0.0))
    for frame, picture in enumerate(pictures):
        words = "And did he?" if frame < 30 else "No, he never does."
        cv2.putText(picture, words, (20, HEIGHT - 8), cv2.FONT_HERSHEY_SIMPLEX, 0.4, (255, 255, 255), 1, cv2.LINE_AA)
    subtitled = find_scenes(pictures, np.arange(FRAMES) / 30)
    assert (subtitled.transitions, subtitled.suspected) == ((), ())


def test_a_jump_is_found_beside_another_cut() -> None:
    """The frames on the other side of that cut do not count as its surroundings."""
    pictures = film(after(33, 60.0))
    pictures[:30] = [picture[:, ::-1] for picture in film(after(0, 0.0))[:30]]
    assert cuts(pictures) == [30, 33]


def test_a_smaller_jump_is_suspected_and_a_certain_cut_is_not_suspected_besides() -> None:
    small = find_scenes(film(lambda t: 10.0 + 1.5 * t + 4.0 * (t >= 30)), np.arange(FRAMES) / 30)
    assert (small.transitions, small.suspected) == ((), (30,))
    assert find_scenes(film(after(30, 60.0)), np.arange(FRAMES) / 30).suspected == ()


@pytest.mark.parametrize("jump_px", [40.0, 0.0])
def test_a_jump_in_a_picture_within_the_picture_is_none(jump_px: float) -> None:
    """A video in the corner jumps (or somebody beside it, where that one goes on) after a cut of the film."""
    detector = SceneDetector(np.arange(FRAMES) / 30)
    size = WIDTH // 2, HEIGHT // 2
    inset = film(after(45, jump_px))
    for frame in range(FRAMES):
        picture = Place(1 if frame < 30 else 2).picture(0).copy()
        left = round(after(45, 40.0 - jump_px)(frame))
        picture[HEIGHT - BLOB_PX :, left : left + BLOB_PX] = BLOB
        picture[: size[1], -size[0] :] = cv2.resize(inset[frame], size, interpolation=cv2.INTER_AREA)
        detector.add(picture)
    assert [one.start for one in detector.finish().transitions] == [30, 45]
    scenes = detector.filmed(2 * WIDTH)
    assert [one.start for one in scenes.transitions] == ([30] if jump_px else [30, 45])
    assert scenes.suspected == ()
    assert all(scenes.burned_in)
