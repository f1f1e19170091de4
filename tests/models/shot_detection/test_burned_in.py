"""What is drawn over two pictures is found where they show different things, and nowhere in one view."""

import cv2
import numpy as np
import pytest
from places import HEIGHT, WIDTH, Place

from humanmm.models.records.shots import Box, Scenes, Shot, Transition
from humanmm.models.shot_detection.burned_in import burned_in, burned_into, cover
from humanmm.models.shot_detection.scenes import find_scenes

CAPTION = np.s_[86:102, 14:130]


def captioned(picture: np.ndarray) -> np.ndarray:
    """A picture with a caption over its lower part."""
    drawn = picture.copy()
    drawn[CAPTION] = (150, 20, 30)
    cv2.putText(drawn, "ALEX JOHN", (18, 99), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (255, 255, 255), 1, cv2.LINE_AA)
    return drawn


def gray(picture: np.ndarray) -> np.ndarray:
    return cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)


def test_a_caption_over_two_places_is_found_and_little_else() -> None:
    found = burned_in(*(gray(captioned(Place(seed).picture(0))) for seed in (1, 2)))
    assert found[CAPTION].mean() > 0.9
    found[82:106, 10:134] = False
    assert found.mean() < 0.05


def test_two_places_without_anything_drawn_over_them_lose_little() -> None:
    assert max(burned_in(gray(Place(k).picture(0)), gray(Place(k + 1).picture(0))).mean() for k in range(8)) < 0.1


@pytest.mark.parametrize("light", [0, 50])
def test_in_one_view_nothing_is_burned_in_whoever_walks_and_however_it_is_lit(light: int) -> None:
    place = Place(3)
    before, after = place.picture(0), cv2.add(place.picture(60), (light, light, light, 0))
    assert not burned_in(gray(before), gray(after)).any()


def test_black_bars_are_burned_in() -> None:
    first, second = (gray(Place(seed).picture(0)) for seed in (1, 2))
    for picture in (first, second):
        picture[:12] = picture[-12:] = 16
    found = burned_in(first, second)
    assert found[:12].all() and found[-12:].all() and found[24:-24].mean() < 0.1


def part_of(boxes: tuple[Box, ...]) -> np.ndarray:
    found = np.zeros((HEIGHT, WIDTH), bool)
    for x0, y0, x1, y1 in boxes:
        found[int(y0) : int(y1), int(x0) : int(x1)] = True
    return found


@pytest.mark.parametrize("shape", ["angle", "frame", "bar", "dots"])
def test_boxes_cover_a_piece_and_little_of_what_it_surrounds(shape: str) -> None:
    piece = np.zeros((HEIGHT, WIDTH), bool)
    if shape in ("angle", "frame"):
        piece[:, 5:25] = piece[90:105, 5:] = True
    if shape == "frame":
        piece[:15] = piece[:, -20:] = True
    if shape == "bar":
        piece[20:40, 30:90] = True
    if shape == "dots":
        piece[::3, ::3] = True
    boxes = [tuple(map(float, box)) for box in cover(piece)]
    covered = part_of(tuple(boxes))
    assert covered[piece].all()
    if shape != "dots":
        assert covered.sum() == piece.sum()
    if shape == "bar":
        assert boxes == [(30, 20, 90, 40)]


def test_every_scene_has_the_boxes_of_what_it_shares_with_its_neighbours() -> None:
    cut, dissolve = Transition("cut", 10, 10, "scene"), Transition("dissolve", 18, 22, "scene")
    place = [Place(1), Place(2), Place(2)]
    samples = {f: gray(captioned(place[k].picture(f))) for k, f in enumerate([5, 12, 20])}  # one in the dissolve
    first, second, third = burned_into(samples, Scenes(40, (cut, dissolve)), WIDTH)
    assert first == second and third == ()
    assert part_of(first)[CAPTION].all() and part_of(first).mean() < 0.3
    assert burned_into({f: gray(Place(1).picture(f)) for f in (5, 25)}, Scenes(40, (cut,)), WIDTH) == ((), ())


def test_bars_on_four_sides_are_a_box_each_and_leave_what_was_filmed() -> None:
    picture = gray(Place(1).picture(0))
    picture[:12] = picture[-12:] = 16
    picture[:, :20] = picture[:, -20:] = 16
    (boxes,) = burned_into({0: picture, 10: picture}, Scenes(20, ()), 2 * WIDTH)
    width, height = Shot(0, 0, 20, 0, None, (), burned_in=boxes).filmed_size(2 * WIDTH, 2 * HEIGHT)
    framed = Shot(0, 0, 20, 0, None, (), burned_in=((0.0, 0.0, 640.0, 360.0), (0.0, 100.0, 640.0, 150.0)))
    assert framed.filmed_size(640, 360) == (640, 360)  # one piece all around what is seen, and one across it
    assert len(boxes) == 4 and width == 2 * (WIDTH - 44) and height == 2 * (HEIGHT - 28)


def test_a_camera_that_moves_shows_what_is_burned_into_its_scene() -> None:
    samples = {10 * k: gray(captioned(Place(1).picture(0, (30.0 * k, 0.0)))) for k in range(5)}
    (boxes,) = burned_into(samples, Scenes(50, ()), WIDTH)
    assert part_of(boxes)[CAPTION].mean() > 0.9 and part_of(boxes).mean() < 0.3
    assert burned_into(samples, Scenes(50, ()), 2 * WIDTH) == (tuple(tuple(2 * x for x in box) for box in boxes),)


def test_a_cut_is_found_though_a_caption_stays() -> None:
    film = [captioned(picture) for picture in Place(1).still(20) + Place(2).still(20)]
    assert [(t.type, t.start) for t in find_scenes(film, np.arange(40) / 25).transitions] == [("cut", 20)]
