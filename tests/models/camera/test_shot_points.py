"""A shot gets what belongs to its frames, and both its ends."""

import numpy as np
import pytest

from humanmm.models.camera.estimate import camera_from_points
from humanmm.models.camera.shot_points import points_of_shot, within, without_transitions
from humanmm.models.records.camera import Intrinsics, PointTracks
from humanmm.models.records.shots import Shot


def tracks(recorded: list[int], end: int, num_points: int = 60) -> PointTracks:
    """Points that stand still, seen in the recorded frames."""
    places = np.random.default_rng(0).uniform(20, 600, (num_points, 2)).astype(np.float32)
    return PointTracks(
        0, end, np.tile(np.arange(num_points, dtype=np.int32), len(recorded)),
        np.repeat(np.array(recorded, np.int32), num_points), np.tile(places, (len(recorded), 1)),
        np.ones(num_points * len(recorded), np.float32), window_px=15.0,
    )  # fmt: skip


@pytest.mark.parametrize(("start", "end"), [(0, 15), (13, 24), (14, 19), (15, 16), (25, 40), (36, 40)])
def test_both_ends_carry_points_though_the_picture_stood_still(start: int, end: int) -> None:
    part = within(tracks([0, 12, 24, 36, 39], 40), start, end)
    assert (part.start, part.end) == (start, end)
    assert {start, end - 1} <= set(part.frame.tolist()) <= set(range(start, end))
    assert (np.diff(part.frame) >= 0).all()
    camera = camera_from_points(part, [], Intrinsics(800.0, 640, 640, "given", 0.0))
    assert camera.source == "static" and len(camera.R_shot_cam) == end - start and not camera.warnings


def test_the_parts_of_a_densely_recorded_scene_make_up_the_scene() -> None:
    scene = tracks(list(range(40)), 40)
    parts = [within(scene, 0, 17), within(scene, 17, 40)]
    for name in ("track", "frame", "xy", "confidence"):
        np.testing.assert_array_equal(np.concatenate([getattr(part, name) for part in parts]), getattr(scene, name))


def test_a_scene_without_points_has_parts_without_points() -> None:
    assert len(within(tracks([], 40), 10, 20).frame) == 0


def test_points_on_what_is_burned_in_are_none_of_the_shots() -> None:
    scene = tracks(list(range(10)), 10)
    kept = points_of_shot(scene, Shot(0, 0, 10, 0, None, (), burned_in=((0.0, 300.0, 640.0, 400.0),)))
    outside = (scene.xy[:, 1] < 292.5) | (scene.xy[:, 1] > 407.5)  # half a window beside it
    np.testing.assert_array_equal(kept.xy, scene.xy[outside])
    assert 0 < len(kept.frame) < len(scene.frame)


def test_frames_of_a_transition_carry_no_points_and_the_clear_ones_beside_them_do() -> None:
    scene = tracks([0, 1, 5, 12, 19], 20)  # the picture stood still before 5, 12 and 19
    kept = without_transitions(scene, (2, 15))
    assert (kept.start, kept.end) == (0, 20)
    assert sorted(set(kept.frame.tolist())) == [2, 5, 12, 14]


def test_a_shot_that_is_all_transition_keeps_its_points() -> None:
    scene = tracks(list(range(20)), 20)
    assert without_transitions(scene, (9, 9)) is scene
