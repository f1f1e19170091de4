"""Known cameras are found again, and no motion is invented where there is none."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from humanmm.models.camera.estimate import camera_from_points
from humanmm.models.camera.model_choice import ZOOM_SPREAD
from humanmm.models.camera.shot_points import without_transitions
from humanmm.models.geometry import rotations
from humanmm.models.geometry.alignment import umeyama_alignment
from humanmm.models.records.camera import EdgeEvidence, PointTracks, ShotCamera


def rotation_errors_deg(camera: ShotCamera, R_true: np.ndarray) -> np.ndarray:
    return np.degrees(rotations.rotation_angle(np.swapaxes(R_true, 1, 2) @ camera.R_shot_cam))


def position_error(camera: ShotCamera, t_true: np.ndarray) -> float:
    """Largest distance after the best scale (same first camera), in units of the path's extent."""
    estimate = camera.t_shot_cam
    scale = (estimate * t_true).sum() / (estimate**2).sum()
    return float(np.linalg.norm(scale * estimate - t_true, axis=1).max() / np.linalg.norm(t_true, axis=1).max())


def test_a_static_camera_is_exactly_static(scene_of: Callable[..., Any]) -> None:
    camera = camera_from_points(scene_of("static").points, (), scene_of("static").intrinsics)
    assert camera.source == "static" and camera.metric
    assert (camera.R_shot_cam == np.eye(3)).all() and (camera.t_shot_cam == 0).all()


def test_a_pan_is_in_the_rotation_alone(scene_of: Callable[..., Any]) -> None:
    scene = scene_of("pan")
    camera = camera_from_points(scene.points, (), scene.intrinsics)
    assert camera.source == "rotation_only"
    assert (camera.t_shot_cam == 0).all()
    assert rotation_errors_deg(camera, scene.R_shot_cam).max() < 0.1
    assert camera.cross_check.two_view_deg < 0.3


@pytest.mark.parametrize("kind", ["pan", "orbit"])
def test_a_camera_goes_on_as_it_moved_where_a_fade_hides_what_it_sees(scene_of: Callable[..., Any], kind: str) -> None:
    scene = scene_of(kind)
    F = scene.points.end
    camera = camera_from_points(without_transitions(scene.points, (6, F - 6)), (), scene.intrinsics)
    hidden_by_deg = rotations.rotation_angle(scene.R_shot_cam[0].T @ scene.R_shot_cam[6]) * 180 / np.pi
    assert hidden_by_deg > 2
    assert rotation_errors_deg(camera, scene.R_shot_cam)[[-6, -1]].max() < 0.3 * hidden_by_deg
    if kind == "orbit":
        assert position_error(camera, scene.t_shot_cam) < 0.1


@pytest.mark.parametrize("rate_hz", [10.0, 30.0])
def test_how_long_a_camera_goes_on_unseen_is_a_time(scene_of: Callable[..., Any], rate_hz: float) -> None:
    scene = scene_of("pan")
    points = replace(scene.points, rate_hz=rate_hz)
    camera = camera_from_points(without_transitions(points, (0, 40)), (), scene.intrinsics)
    stops = 39 + round(0.4 * rate_hz)
    assert np.abs(camera.R_shot_cam[stops] - camera.R_shot_cam[stops - 1]).max() > 1e-4
    assert np.abs(camera.R_shot_cam[-1] - camera.R_shot_cam[stops]).max() < 1e-9


def test_a_camera_that_had_stopped_before_a_fade_stays(scene_of: Callable[..., Any]) -> None:
    scene = scene_of("pan")
    stopped = scene.points.frame < 40  # the picture stands still then, and nothing is recorded until the last frame
    part = replace(scene.points, **{
        name: getattr(scene.points, name)[stopped] for name in ("track", "frame", "xy", "confidence")
    })  # fmt: skip
    camera = camera_from_points(without_transitions(part, (0, 50)), (), scene.intrinsics)
    assert np.abs(camera.R_shot_cam[-1] - camera.R_shot_cam[39]).max() < 1e-3


@pytest.mark.parametrize("kind", ["dolly", "orbit", "forward", "hand-held"])
def test_a_moving_camera_is_followed(scene_of: Callable[..., Any], kind: str) -> None:
    scene = scene_of(kind)
    told: list[int] = []
    camera = camera_from_points(scene.points, (), scene.intrinsics, progress=lambda done, total: told.append(done))
    assert told == sorted(set(told)) and len(told) > 10 and told[-1] == scene.points.end - scene.points.start
    assert camera.source == "tracked" and not camera.metric
    assert not camera.zooms and not camera.warnings
    assert rotation_errors_deg(camera, scene.R_shot_cam).max() < 0.3  # 0.3 px of noise is 0.02 degrees a point
    assert position_error(camera, scene.t_shot_cam) < 0.05


def test_the_same_points_give_the_same_camera(scene_of: Callable[..., Any]) -> None:
    scene = scene_of("dolly", num_frames=30)
    first, second = (camera_from_points(scene.points, (), scene.intrinsics) for _ in range(2))
    assert (first.R_shot_cam == second.R_shot_cam).all() and (first.t_shot_cam == second.t_shot_cam).all()


def test_without_background_the_camera_is_a_declared_fallback(scene_of: Callable[..., Any]) -> None:
    scene = scene_of("pan")
    few = scene.points.track < 6
    points = replace(
        scene.points, track=scene.points.track[few], frame=scene.points.frame[few], xy=scene.points.xy[few],
        confidence=scene.points.confidence[few],
    )  # fmt: skip
    camera = camera_from_points(points, (), scene.intrinsics)
    assert camera.source == "fallback"
    assert "background points" in camera.warnings[0]


@pytest.mark.parametrize(("kind", "said"), [("static", "taken to stand"), ("pan", "a guess"), ("orbit", "a guess")])
def test_a_camera_is_a_declared_fallback_where_no_point_survives_a_frame(
    scene_of: Callable[..., Any], kind: str, said: str
) -> None:
    scene = scene_of(kind)
    after = scene.points.frame >= 30
    points = replace(scene.points, track=scene.points.track + after * np.int32(scene.points.track.max() + 1))
    camera = camera_from_points(points, (), scene.intrinsics)
    assert camera.source == "fallback" and camera.travels == (kind == "orbit")
    assert "hardly any point survives frame 30" in camera.warnings[0] and said in camera.warnings[0]
    assert rotation_errors_deg(camera, scene.R_shot_cam)[:30].max() < 0.3


@pytest.mark.parametrize("num_frames", [1, 2, 3, 5])
def test_a_shot_of_a_few_frames_works(scene_of: Callable[..., Any], num_frames: int) -> None:
    scene = scene_of("pan", num_frames=num_frames)
    camera = camera_from_points(scene.points, (), scene.intrinsics)
    assert camera.R_shot_cam.shape == (num_frames, 3, 3)
    assert rotation_errors_deg(camera, scene.R_shot_cam).max() < 0.5


ZOOM = np.linspace(1.0, 1.3, 60)


def zoomed(scene: Any) -> PointTracks:
    """The scene's points through a lens whose focal length grows by ZOOM."""
    middle = np.array([scene.intrinsics.width, scene.intrinsics.height]) / 2
    factor = ZOOM[scene.points.frame][:, None]
    return replace(scene.points, xy=(middle + factor * (scene.points.xy - middle)).astype(np.float32))


def test_a_zoom_is_not_taken_for_motion_and_every_frame_has_its_focal_length(scene_of: Callable[..., Any]) -> None:
    scene = scene_of("pan")
    unknown = replace(scene.intrinsics, focal_px=1100.0, source="default", relative_uncertainty=0.4)
    camera = camera_from_points(zoomed(scene), (), unknown)
    assert camera.source == "rotation_only"
    assert "the camera zooms: its focal length changes by 30 %" in camera.warnings[0]
    np.testing.assert_allclose(camera.K[:, 0, 0], scene.intrinsics.focal_px * ZOOM, rtol=0.02)
    np.testing.assert_array_equal(camera.K[:, 0, 0], camera.K[:, 1, 1])
    assert (camera.K[:, :2, 2] == [scene.intrinsics.width / 2, scene.intrinsics.height / 2]).all()
    assert rotation_errors_deg(camera, scene.R_shot_cam).max() < 0.5


def test_a_step_forward_that_a_zoom_explains_nearly_as_well_is_told(scene_of: Callable[..., Any]) -> None:
    clear, noisy = (scene_of("forward", num_frames=40, noise_px=noise) for noise in (0.3, 2.0))
    assert camera_from_points(clear.points, (), clear.intrinsics).warnings == ()
    camera = camera_from_points(noisy.points, (), noisy.intrinsics)
    assert camera.source == "tracked"
    assert "or zooms where it stands" in camera.warnings[0]


def test_a_zoom_without_a_rotation_determines_no_focal_length_and_keeps_the_videos_in_its_middle(
    scene_of: Callable[..., Any],
) -> None:
    scene = scene_of("static")
    unknown = replace(scene.intrinsics, focal_px=1100.0, source="default", relative_uncertainty=0.4)
    camera = camera_from_points(zoomed(scene), (), unknown)
    focals = camera.K[:, 0, 0]
    assert camera.source == "rotation_only"
    np.testing.assert_allclose(focals / focals[0], ZOOM, rtol=0.005)
    assert np.exp(np.log(focals).mean()) == pytest.approx(1100.0, rel=0.05)
    assert rotation_errors_deg(camera, scene.R_shot_cam).max() < 0.1


def test_straight_edges_tell_where_in_its_range_a_zoom_begins(scene_of: Callable[..., Any]) -> None:
    """A standing camera's zoom has a ratio, no focal length: the walls of one frame have."""
    scene = scene_of("static")
    log_focal = np.log(900.0) + np.linspace(-0.5, 0.5, 41)
    sharp = -0.5 * ((log_focal - np.log(900.0 * ZOOM[30])) / 0.03) ** 2
    elsewhere = EdgeEvidence(80, log_focal, -0.5 * ((log_focal - np.log(700.0)) / 0.03) ** 2)
    known = replace(scene.intrinsics, source="estimated", relative_uncertainty=0.03)
    for edges, first, known_to in (
        ((EdgeEvidence(30, log_focal, sharp), elsewhere), 900.0, 3),
        ((elsewhere,), 900.0 / 1.14, round(100 * np.hypot(ZOOM_SPREAD, 0.03))),
    ):
        camera = camera_from_points(zoomed(scene), (), replace(known, edges=edges))
        assert f"px, both known to {known_to} %" in camera.warnings[0]
        assert camera.K[0, 0, 0] == pytest.approx(first, rel=0.03)
        np.testing.assert_allclose(camera.K[:, 0, 0] / camera.K[0, 0, 0], ZOOM, rtol=0.005)


@pytest.mark.parametrize("kind", ["static", "pan", "hand-held"])
def test_a_given_focal_length_is_that_of_the_first_frame_of_a_zoom(scene_of: Callable[..., Any], kind: str) -> None:
    scene = scene_of(kind)
    camera = camera_from_points(zoomed(scene), (), replace(scene.intrinsics, source="given", relative_uncertainty=0.0))
    np.testing.assert_allclose(camera.K[:, 0, 0], scene.intrinsics.focal_px * ZOOM, rtol=0.02)
    assert "px, if the given one is that of its first frame)" in camera.warnings[0]


def test_a_zoom_in_the_hand_is_reported_from_the_hands_motion(scene_of: Callable[..., Any]) -> None:
    scene = scene_of("hand-held")
    camera = camera_from_points(zoomed(scene), (), scene.intrinsics)
    assert camera.source == "tracked"
    assert "the camera zooms as it travels" in camera.warnings[0]
    np.testing.assert_allclose(camera.K[:, 0, 0], scene.intrinsics.focal_px * ZOOM, rtol=0.02)
    assert rotation_errors_deg(camera, scene.R_shot_cam).max() < 0.5


@pytest.mark.parametrize(("kind", "wrong"), [("dolly", 1.0), ("orbit", 1.0), ("dolly", 1.25)])
def test_a_zoom_on_the_way_is_found_beside_the_travel(scene_of: Callable[..., Any], kind: str, wrong: float) -> None:
    """Also with a wrong focal length: the zoom is a ratio."""
    scene = scene_of(kind)
    assumed = replace(scene.intrinsics, focal_px=wrong * scene.intrinsics.focal_px)
    camera = camera_from_points(zoomed(scene), (), assumed)
    assert camera.source == "tracked" and "zooms as it travels" in camera.warnings[0]
    focals = camera.K[:, 0, 0]
    np.testing.assert_allclose(focals[-1] / focals[0], ZOOM[-1], rtol=0.05)
    if wrong == 1.0:
        moved = umeyama_alignment(camera.t_shot_cam, scene.t_shot_cam, unique=False).apply(camera.t_shot_cam)
        assert np.abs(moved - scene.t_shot_cam).max() < 0.05 * np.ptp(scene.t_shot_cam, axis=0).max()


def test_the_users_word_settles_it(scene_of: Callable[..., Any]) -> None:
    scene = scene_of("pan")
    camera = camera_from_points(scene.points, (), scene.intrinsics, static=True)
    assert camera.source == "given" and (camera.R_shot_cam == np.eye(3)).all()
