"""The focal length is the user's, or what the background tells, or an honest prior."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from room_edges import camera_towards, edges_of_a_room, seen_by

from humanmm.errors import ConfigError
from humanmm.models.camera.background.keyframes import FrameFeatures
from humanmm.models.camera.focal_length import distortion
from humanmm.models.camera.focal_length.intrinsics import (
    MAX_PICTURES,
    ShotPoints,
    given_intrinsics,
    intrinsics_from_background,
)
from humanmm.models.camera.odometry.keyframe_odometry import EXACT_FRACTION
from humanmm.models.geometry.intrinsics import K_from_focal, default_focal_px
from humanmm.models.records.camera import PointTracks


def test_a_field_of_view_is_horizontal() -> None:
    given = given_intrinsics(1920, 1080, focal_px=None, fov_deg=90.0)
    assert given is not None and given.source == "given"
    assert given.focal_px == pytest.approx(960.0)


def test_two_focal_lengths_exclude_each_other() -> None:
    with pytest.raises(ConfigError, match="focal_px and fov_deg exclude each other"):
        given_intrinsics(1920, 1080, focal_px=1000.0, fov_deg=50.0)


@pytest.mark.parametrize("kind", ["pan", "hand-held", "orbit", "dolly"])
def test_a_camera_that_rotates_or_moves_determines_its_focal_length(scene_of: Callable[..., Any], kind: str) -> None:
    scene = scene_of(kind)
    found = intrinsics_from_background([ShotPoints(scene.points, ())], scene.intrinsics.width, scene.intrinsics.height)
    assert found.source == "estimated"
    error = abs(math.log(found.focal_px / scene.intrinsics.focal_px))
    assert error < 0.05 and error < 3 * found.relative_uncertainty


@pytest.mark.parametrize("kind", ["static", "sideways"])
def test_a_camera_that_shows_nothing_of_its_lens_leaves_the_default(scene_of: Callable[..., Any], kind: str) -> None:
    scene = scene_of(kind)  # a camera that slides without turning fits every focal length equally well
    found = intrinsics_from_background([ShotPoints(scene.points, ())], scene.intrinsics.width, scene.intrinsics.height)
    assert found.source == "default"
    assert found.focal_px == default_focal_px(scene.intrinsics.width, scene.intrinsics.height)
    assert found.relative_uncertainty > 0.2
    assert "--focal-px" in found.warnings[0]


def test_bars_beside_the_film_say_nothing_of_the_lens() -> None:
    found = intrinsics_from_background([], 640, 1138, filmed=(640.0, 360.0))
    assert found.source == "default" and found.focal_px == default_focal_px(640, 360)


def test_shots_agree_on_one_focal_length(scene_of: Callable[..., Any]) -> None:
    shots = [scene_of(kind, seed=seed) for seed, kind in enumerate(["static", "hand-held", "pan"])]
    found = intrinsics_from_background([ShotPoints(shot.points, ()) for shot in shots], 960, 540)
    assert found.focal_px == pytest.approx(shots[0].intrinsics.focal_px, rel=0.03)
    assert {one.model for one in found.models} <= {"moving", "rotation only"} and found.models


def with_lens(points: PointTracks, ratio: float) -> PointTracks:
    """The same seen with a lens that is so many times as long."""
    middle = np.array([480.0, 270.0])
    return replace(points, xy=(middle + ratio * (points.xy - middle)).astype(np.float32))


def moved(points: PointTracks, start: int) -> PointTracks:
    """The same, later in the video."""
    return replace(
        points, start=points.start + start, end=points.end + start, frame=(points.frame + start).astype(np.int32)
    )


def test_a_shot_with_a_lens_of_its_own_gets_it(scene_of: Callable[..., Any]) -> None:
    first, second, third = (scene_of(kind, seed=seed) for seed, kind in enumerate(["hand-held", "pan", "pan"]))
    points = [first.points, moved(with_lens(second.points, 1.5), 60), moved(third.points, 120)]
    found = intrinsics_from_background([ShotPoints(one, ()) for one in points], 960, 540)
    true_px = first.intrinsics.focal_px
    assert found.focal_px == pytest.approx(true_px, rel=0.03)
    assert [(lens.start, lens.end) for lens in found.lenses] == [(60, 120)]
    own = found.of_shot(60, 120)
    assert own.focal_px == pytest.approx(1.5 * true_px, rel=0.03) and own.source == "estimated"
    assert found.of_shot(0, 60) is found


def test_an_editors_closer_cut_is_the_same_camera_with_a_longer_lens() -> None:
    true_px = 1.25 * default_focal_px(960, 540)
    (wide, other) = wall_pictures(true_px, [30.0, 75.0])
    noise = np.random.default_rng(0)
    xy = noise.uniform([300, 170], [660, 370], (80, 2)).astype(np.float32)
    descriptors = noise.integers(0, 256, (80, 128)).astype(np.uint8)
    middle = np.array([480.0, 270.0], np.float32)
    wide = replace(wide, xy=xy, descriptors=descriptors)
    closer = replace(
        wide,
        frame=1,
        xy=middle + 1.4 * (xy - middle),
        segments=np.tile(middle, 2) + 1.4 * (wide.segments - np.tile(middle, 2)),
    )
    other = replace(other, frame=2)
    found = intrinsics_from_background([], 960, 540, [[wide], [closer], [other]])
    assert found.of_shot(1, 2).focal_px == pytest.approx(1.4 * found.focal_px, rel=0.005)
    assert found.of_shot(0, 1) is found and found.of_shot(2, 3) is found


def test_a_zoom_makes_the_focal_length_uncertain_not_wrong(scene_of: Callable[..., Any]) -> None:
    scene = scene_of("pan")
    factor = np.linspace(1.0, 1.2, 60)[scene.points.frame][:, None]
    middle = np.array([scene.intrinsics.width, scene.intrinsics.height]) / 2
    points = replace(scene.points, xy=(middle + factor * (scene.points.xy - middle)).astype(np.float32))
    found = intrinsics_from_background([ShotPoints(points, ())], scene.intrinsics.width, scene.intrinsics.height)
    assert 0.1 < found.relative_uncertainty < 0.3
    assert found.focal_px == pytest.approx(scene.intrinsics.focal_px, rel=0.15)


def test_a_path_that_fits_its_points_badly_says_less_than_their_number_promises(
    scene_of: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(distortion, "USUAL_STD", 1e-9)  # of the points alone: what lenses may bend comes to it
    scene, noise = scene_of("orbit"), np.random.default_rng(0)
    width, height = scene.intrinsics.width, scene.intrinsics.height
    fits, rough = 0.2, 5 * EXACT_FRACTION * np.hypot(width, height)
    stated = []
    for sigma_px in (fits, rough):
        xy = scene.points.xy + noise.normal(0, sigma_px, scene.points.xy.shape)
        points = replace(scene.points, xy=xy.astype(np.float32))
        stated.append(intrinsics_from_background([ShotPoints(points, ())], width, height).relative_uncertainty)
    assert stated[0] < 0.06 and stated[1] > 0.2  # by its number of points alone the second would be known to 0.06


def wall_pictures(focal_px: float, headings_deg: Sequence[float]) -> list[FrameFeatures]:
    """Key frames of a room, as cameras that never move see it."""
    K = K_from_focal(focal_px, 960, 540)
    pictures = []
    for frame, heading in enumerate(headings_deg):
        ends = edges_of_a_room(np.random.default_rng(frame), each=20)
        segments = seen_by(ends, camera_towards(heading, 12.0), K).astype(np.float32)
        pictures.append(FrameFeatures(frame, np.zeros((0, 2), np.float32), np.zeros((0, 128), np.uint8), segments))
    return pictures


def test_walls_determine_the_focal_length_of_cameras_that_never_move() -> None:
    true_px = 1.25 * default_focal_px(960, 540)
    found = intrinsics_from_background([], 960, 540, [[one] for one in wall_pictures(true_px, [30.0, 75.0, 140.0])])
    assert found.source == "estimated"
    assert abs(np.log(found.focal_px / true_px)) < 2 * found.relative_uncertainty < 0.25


def test_a_picture_of_another_lens_does_not_drag_the_rest_away() -> None:
    true_px = default_focal_px(960, 540)
    pictures = [*wall_pictures(true_px, [30.0, 75.0, 140.0]), *wall_pictures(1.6 * true_px, [50.0])]
    found = intrinsics_from_background([], 960, 540, [[one] for one in pictures])
    assert abs(np.log(found.focal_px / true_px)) < 0.1


def test_of_many_shots_those_with_the_longest_edges_are_used() -> None:
    pictures = [replace(one, frame=k) for k, one in enumerate(wall_pictures(800.0, [10.0 * k for k in range(8)]))]
    pictures[2] = replace(pictures[2], segments=0.5 * pictures[2].segments)
    found = intrinsics_from_background([], 960, 540, [[one] for one in pictures])
    assert len(found.edges) <= MAX_PICTURES and 2 not in {one.frame for one in found.edges}
