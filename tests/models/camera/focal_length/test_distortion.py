"""A lens that bends straight lines is found out by cameras that turn or travel, together with its focal length."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from humanmm.models.camera.background.keyframes import FrameFeatures
from humanmm.models.camera.focal_length.distortion import DistortionEvidence, distortion_evidence, together
from humanmm.models.camera.focal_length.intrinsics import ShotPoints, intrinsics_from_background
from humanmm.models.camera.model_choice import choose_model
from humanmm.models.camera.odometry.tracked_shot import arrange
from humanmm.models.camera.shot_camera import estimate_camera
from humanmm.models.geometry.intrinsics import straightened
from humanmm.models.geometry.rotations import angle_between_deg
from humanmm.models.records.camera import Intrinsics, OwnLens, PointTracks
from humanmm.models.records.shots import Shot
from humanmm.models.records.tracks import ScenePeople

BARREL = -0.06


def bent(xy: np.ndarray, distortion: float, width: float = 960, height: float = 540) -> np.ndarray:
    """What a lens with this distortion shows where a pinhole camera has these pixels: the inverse of `straightened`."""
    middle = np.array([width, height]) / 2
    off = xy - middle
    rho = np.linalg.norm(off, axis=-1, keepdims=True) / np.linalg.norm(middle)
    # ρ = ρ_d / (1 + distortion ρ_d²), solved for ρ_d
    factor = 2 / (1 + np.sqrt(1 - 4 * distortion * rho**2))
    return np.asarray(middle + off * factor)


def through_a_barrel(points: PointTracks) -> PointTracks:
    return replace(points, xy=bent(points.xy.astype(float), BARREL).astype(np.float32))


def test_what_a_lens_bent_is_made_straight() -> None:
    xy = np.random.default_rng(0).uniform([0, 0], [960, 540], (50, 2))
    np.testing.assert_allclose(straightened(bent(xy, BARREL), BARREL, 960, 540), xy, atol=1e-9)
    corner = straightened(np.array([0.0, 0.0]), BARREL, 960, 540)
    assert np.hypot(*(corner - [480, 270])) == pytest.approx(np.hypot(480, 270) / (1 + BARREL))
    assert straightened(xy, 0.0, 960, 540) is xy


@pytest.mark.parametrize("kind", ["pan", "orbit"])
def test_a_camera_that_turns_or_travels_tells_how_its_lens_bends(scene_of: Callable[..., Any], kind: str) -> None:
    scene = scene_of(kind)
    plain = intrinsics_from_background([ShotPoints(scene.points, ())], 960, 540)
    assert plain.distortion == 0 and not plain.warnings
    found = intrinsics_from_background([ShotPoints(through_a_barrel(scene.points), ())], 960, 540)
    assert found.distortion == pytest.approx(BARREL, abs=0.012)
    assert found.focal_px == pytest.approx(scene.intrinsics.focal_px, rel=0.04)
    assert any("the lens bends straight lines" in warning for warning in found.warnings)


def test_the_camera_of_a_shot_is_found_in_the_straightened_picture(scene_of: Callable[..., Any]) -> None:
    scene = scene_of("pan")
    points, people = through_a_barrel(scene.points), ScenePeople(0, scene.points.end, ())
    shot = Shot(0, 0, scene.points.end, 0, None, ())

    def off_deg(distortion: float) -> float:
        intrinsics = replace(scene.intrinsics, source="given", distortion=distortion)
        camera = estimate_camera(shot, points, people, intrinsics)
        return float(angle_between_deg(camera.R_shot_cam[-1], scene.R_shot_cam[-1]))

    assert off_deg(BARREL) < 0.3 * off_deg(0.0)


def test_nothing_is_said_by_a_static_camera(scene_of: Callable[..., Any]) -> None:
    scene = scene_of("static")
    shot = arrange(scene.points, 960, 540)
    assert distortion_evidence(shot, choose_model(shot, scene.intrinsics, calibrate=True)) is None
    assert together([]) == (0.0, math.inf)


def test_what_shots_say_counts_by_how_sure_it_is() -> None:
    left, std = together([DistortionEvidence(-0.06, 0.01, 7.0), DistortionEvidence(0.0, 0.02, 7.0)])
    assert left == pytest.approx(-0.048) and std == pytest.approx(0.01 / math.sqrt(1.25))
    # Where the points say nothing, a lens is what lenses usually are.
    assert DistortionEvidence(0.0, 10.0, 7.0).log_focal_std(math.inf) == pytest.approx(0.07)


def test_a_lens_of_its_own_bends_as_it_does() -> None:
    own = OwnLens(10, 20, 900.0, "estimated", 0.03, distortion=-0.02)
    shared = Intrinsics(600.0, 960, 540, "estimated", 0.03, distortion=-0.05, lenses=(own,))
    assert shared.of_shot(10, 20).distortion == -0.02 and shared.of_shot(0, 10).distortion == -0.05


def test_features_and_edges_of_a_key_frame_are_straightened() -> None:
    straight = np.array([[100, 100], [800, 500], [40, 30], [900, 60]], float)
    seen = bent(straight, BARREL).astype(np.float32)
    frame = FrameFeatures(3, seen[:2], np.zeros((2, 128), np.uint8), seen[2:].reshape(1, 4))
    found = frame.straightened(BARREL, 960, 540)
    np.testing.assert_allclose(np.concatenate([found.xy, found.segments.reshape(2, 2)]), straight, atol=1e-3)
    assert frame.straightened(0.0, 960, 540) is frame
