"""The focal length is the user's, or what the background tells, or an honest prior."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from humanmm.models.camera.intrinsics import ShotPoints, given_intrinsics, intrinsics_from_background
from humanmm.models.geometry.intrinsics import default_focal_px


def test_a_field_of_view_is_horizontal() -> None:
    given = given_intrinsics(1920, 1080, focal_px=None, fov_deg=90.0)
    assert given is not None and given.source == "given"
    assert given.focal_px == pytest.approx(960.0)


@pytest.mark.parametrize("kind", ["pan", "hand-held", "orbit", "dolly"])
def test_a_camera_that_turns_or_moves_tells_its_focal_length(scene_of: Callable[..., Any], kind: str) -> None:
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


def test_shots_agree_on_one_focal_length(scene_of: Callable[..., Any]) -> None:
    shots = [scene_of(kind, seed=seed) for seed, kind in enumerate(["static", "hand-held", "pan"])]
    found = intrinsics_from_background([ShotPoints(shot.points, ()) for shot in shots], 960, 540)
    assert found.focal_px == pytest.approx(shots[0].intrinsics.focal_px, rel=0.03)


def test_a_zoom_makes_the_focal_length_uncertain_not_wrong(scene_of: Callable[..., Any]) -> None:
    scene = scene_of("pan")
    factor = np.linspace(1.0, 1.2, 60)[scene.points.frame][:, None]
    middle = np.array([scene.intrinsics.width, scene.intrinsics.height]) / 2
    points = replace(scene.points, xy=(middle + factor * (scene.points.xy - middle)).astype(np.float32))
    found = intrinsics_from_background([ShotPoints(points, ())], scene.intrinsics.width, scene.intrinsics.height)
    assert 0.1 < found.relative_uncertainty < 0.3
    assert found.focal_px == pytest.approx(scene.intrinsics.focal_px, rel=0.15)
