"""Top view: what it must show, and that threads do not meet in matplotlib."""

import dataclasses
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from humanmm.models.drawing import palette
from humanmm.models.drawing.timeline import timeline
from humanmm.models.drawing.top_view import top_view
from humanmm.models.records.recording import Recording


def _fraction(image: np.ndarray, color: palette.RGB) -> float:
    return float((image == np.array(color)).all(-1).mean())


def test_the_top_view_shows_the_path_of_everybody_and_the_cuts(standing: Recording) -> None:
    image = top_view(standing)
    assert image.shape == (1000, 1000, 3)
    assert _fraction(image, palette.person_color(standing.people[0])) > 1e-4
    assert _fraction(image, palette.CUT) > 1e-5
    uncut = dataclasses.replace(standing, cut_frames=(), shot_index=np.zeros(40, np.int32))
    assert _fraction(top_view(uncut), palette.CUT) == 0


def test_the_top_view_takes_a_person_without_frames_and_a_camera_that_looks_down(standing: Recording) -> None:
    nobody = {
        name: value[:0] if isinstance(value, np.ndarray) and name != "betas" else value
        for name, value in vars(standing.people[0]).items()
    }
    empty = dataclasses.replace(standing.people[0], **{**nobody, "person": 1})
    down = np.tile(np.float32([[1, 0, 0], [0, -1, 0], [0, 0, -1]]), (40, 1, 1))
    image = top_view(dataclasses.replace(standing, people=(standing.people[0], empty), R_world_cam=down))
    assert _fraction(image, palette.person_color(standing.people[0])) > 1e-4
    alone = top_view(dataclasses.replace(standing, R_world_cam=down))
    differing = np.argwhere((image != alone).any(axis=-1))
    assert len(differing) < 0.01 * image[..., 0].size, "who has no frames is in the legend alone"


def test_worlds_that_nothing_joins_have_axes_of_their_own(standing: Recording) -> None:
    first = standing.people[0]
    green = dataclasses.replace(first, person=2, observed=first.frame >= standing.cut_frames[0])
    blue = dataclasses.replace(first, observed=first.frame < standing.cut_frames[0])
    image = top_view(dataclasses.replace(standing, people=(blue, green), worlds=(0, 1)))
    assert image.shape == (1000, 1000, 3)
    panels = image[30:900, :500], image[30:900, 500:]
    for person, own, other in ((blue, *panels), (green, *reversed(panels))):
        color = palette.person_color(person)
        assert _fraction(own, color) > 1e-4 and _fraction(other, color) == 0


def test_a_world_without_people_takes_no_room(standing: Recording) -> None:
    alone = dataclasses.replace(standing, worlds=(0, 1))
    first = alone.people[0]
    seen = dataclasses.replace(first, observed=first.frame < standing.cut_frames[0])
    image = top_view(dataclasses.replace(alone, people=(seen,)))
    assert _fraction(image, palette.person_color(seen)) > 1e-4


def test_charts_drawn_by_four_threads_at_once_equal_those_drawn_alone(standing: Recording) -> None:
    alone = top_view(standing), timeline(standing, [], [], [])
    with ThreadPoolExecutor(4) as pool:
        tops = [pool.submit(top_view, standing) for _ in range(4)]
        lines = [pool.submit(timeline, standing, [], [], []) for _ in range(4)]
        for top, line in zip(tops, lines, strict=True):
            np.testing.assert_array_equal(top.result(), alone[0])
            np.testing.assert_array_equal(line.result(), alone[1])
