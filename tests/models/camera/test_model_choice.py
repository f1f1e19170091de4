"""The simplest camera that explains the background is chosen, whatever focal length is assumed."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from humanmm.models.camera.model_choice import choose_model, settled_model, track_model
from humanmm.models.camera.odometry.tracked_shot import arrange
from humanmm.models.records.camera import Intrinsics

WANTED = {"static": "static", "pan": "rotation only", "orbit": "moving", "hand-held": "moving"}


@pytest.mark.parametrize("calibrate", [False, True])
@pytest.mark.parametrize("kind", list(WANTED))
def test_the_choice_is_the_true_kind_of_camera(scene_of: Callable[..., Any], kind: str, calibrate: bool) -> None:
    scene = scene_of(kind)
    shot = arrange(scene.points, scene.intrinsics.width, scene.intrinsics.height)
    assert choose_model(shot, scene.intrinsics, calibrate=calibrate).model == WANTED[kind]


def test_calibrating_finds_the_focal_length_that_was_not_assumed(scene_of: Callable[..., Any]) -> None:
    scene = scene_of("pan")
    assumed = Intrinsics(1.2 * scene.intrinsics.focal_px, 960, 540, "default", 0.4)
    choice = choose_model(arrange(scene.points, 960, 540), assumed, calibrate=True)
    assert choice.rotating is not None
    assert choice.rotating.track.views.focal_px == pytest.approx(scene.intrinsics.focal_px, rel=0.03)
    assert choice.rotating.log_focal_sigma < 0.05


@pytest.mark.parametrize("kind", ["pan", "orbit"])
def test_a_settled_model_has_the_tracks_that_choosing_again_would_have(scene_of: Callable[..., Any], kind: str) -> None:
    scene = scene_of(kind)
    shot = arrange(scene.points, 960, 540)
    model = settled_model(choose_model(shot, scene.intrinsics, calibrate=True), shot, scene.intrinsics)
    assert model == WANTED[kind]
    settled, chosen = track_model(shot, scene.intrinsics, model), choose_model(shot, scene.intrinsics)
    assert settled is not None and settled.model == chosen.model
    ours, theirs = (c.moving if model == "moving" else c.rotating for c in (settled, chosen))
    assert ours is not None and theirs is not None
    np.testing.assert_array_equal(ours.track.views.R_shot_cam, theirs.track.views.R_shot_cam)
    np.testing.assert_array_equal(ours.track.views.t_shot_cam, theirs.track.views.t_shot_cam)


def test_a_model_found_with_another_focal_length_is_not_settled(scene_of: Callable[..., Any]) -> None:
    scene = scene_of("orbit")
    shot = arrange(scene.points, 960, 540)
    choice = choose_model(shot, scene.intrinsics, calibrate=True)
    other = replace(scene.intrinsics, focal_px=1.2 * scene.intrinsics.focal_px)
    assert settled_model(choice, shot, other) is None
