"""Stage `points`: points of one scene alone, as many as the user wants, in pixels of the video."""

from typing import Any

import numpy as np
import pytest
from held_results import inputs_of

from humanmm.models.records.camera import PointTracks
from humanmm.models.records.shots import Scenes, Transition
from humanmm.tasks.points import points


def _tracked(film: Any, scene: int, **settings: Any) -> PointTracks:
    cut = Scenes(film.facts.num_frames, (Transition("cut", film.CUT, film.CUT, "scene"),))
    given = inputs_of("points", {"decode": film.facts, "scenes": cut}, scene, video=film.video, points=settings)
    return points(given)


def test_points_of_a_scene_move_as_the_camera_pans(film: Any) -> None:
    found = _tracked(film, 1, max_side_px=160)  # in pictures that are smaller than the video's
    assert (found.start, found.end) == (film.CUT, film.facts.num_frames)
    assert found.frame.min() == film.CUT and found.frame.max() == found.end - 1
    order = np.lexsort((found.frame, found.track))
    track, frame, xy = found.track[order], found.frame[order], found.xy[order]
    follows = (np.diff(track) == 0) & (np.diff(frame) == 1)
    steps = np.diff(xy, axis=0)[follows]
    np.testing.assert_allclose(np.median(steps, axis=0), [-film.PAN_PX, 0.0], atol=0.1)
    assert found.window_px == pytest.approx(film.SIZE[0] / 160 * _tracked(film, 1).window_px), "larger in the video"


def test_about_as_many_points_are_followed_as_the_user_wants(film: Any) -> None:
    few, many = (_tracked(film, 0, num_points=number) for number in (32, 200))
    assert 16 < np.bincount(few.frame).max() <= 40 < np.bincount(many.frame).max()
