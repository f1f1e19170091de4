"""The world from the side: everybody in the picture, feet on the floor, a place at a time."""

import dataclasses

import numpy as np
import two_people

from humanmm.models.drawing import palette
from humanmm.models.drawing.world_view import WorldView
from humanmm.models.records.recording import RecordedPerson
from humanmm.models.video.colors import BT601

WIDTH, HEIGHT = 640, 480


def _drawn(view: WorldView, frame: int) -> np.ndarray:
    image = np.zeros((HEIGHT * 3 // 2, WIDTH), np.uint8)
    view.draw(image, frame)
    return image


def _where(image: np.ndarray, color: palette.RGB) -> np.ndarray:
    """(n,2) x and y where the chroma is about that of a colour."""
    _, cb, cr = BT601.samples(np.array(color, np.uint8)).astype(int)
    chroma = image[HEIGHT:].reshape(2, HEIGHT // 2, WIDTH // 2).astype(int)
    y, x = np.nonzero((np.abs(chroma[0] - cb) < 14) & (np.abs(chroma[1] - cr) < 14))
    return 2 * np.column_stack([x, y])


def test_both_people_stand_in_the_picture_in_their_colours_between_floor_and_head_room() -> None:
    recording = two_people.recording()
    image = _drawn(WorldView(recording, [0, 0], WIDTH, HEIGHT), 20)
    for person in recording.people:
        found = _where(image, palette.person_color(person))
        assert len(found) > 100
        x, y = np.median(found, axis=0)
        assert 0.05 * WIDTH < x < 0.95 * WIDTH and 0.1 * HEIGHT < y < 0.9 * HEIGHT


def test_a_place_shows_its_own_people_alone() -> None:
    recording = two_people.recording()
    first, second = recording.people
    apart = dataclasses.replace(
        recording,
        people=(
            dataclasses.replace(first, observed=first.frame < two_people.CUT),
            dataclasses.replace(second, observed=second.frame >= two_people.CUT),
        ),
    )
    view = WorldView(apart, [0, 1], WIDTH, HEIGHT)
    for frame, shown, hidden in ((10, 0, 1), (30, 1, 0)):
        image = _drawn(view, frame)
        assert len(_where(image, palette.PEOPLE[shown])) > 100
        assert len(_where(image, palette.PEOPLE[hidden])) < 20, "the camera's lines are orange too"


def test_a_long_way_is_followed_smoothly() -> None:
    recording = two_people.recording(num_frames=60)
    speed = np.linspace(0, 30, 60)[:, None]
    moved = tuple(_moved(person, speed[person.frame]) for person in recording.people)
    view = WorldView(dataclasses.replace(recording, people=moved, cut_frames=()), [0, 0], WIDTH, HEIGHT)
    for frame in (0, 30, 59):
        assert len(_where(_drawn(view, frame), palette.PEOPLE[0])) > 100


def test_nobody_at_all_is_an_empty_floor() -> None:
    empty = dataclasses.replace(two_people.recording(), people=())
    image = _drawn(WorldView(empty, [0, 0], WIDTH, HEIGHT), 0)
    assert image[:HEIGHT].std() > 1


def _moved(person: RecordedPerson, along: np.ndarray) -> RecordedPerson:
    offset = np.column_stack([along, np.zeros((len(along), 2))]).astype(np.float32)
    return dataclasses.replace(person, joints=person.joints + offset[:, None], transl=person.transl + offset)
