"""Static cameras are recognised whatever moves before them, and slow motion is not taken for static."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from humanmm.models.camera.odometry.tracked_shot import arrange
from humanmm.models.camera.static import is_static


def moved(scene: Any, displacement: np.ndarray, share: float) -> Any:
    """Observations with (frames, 2) added for this fraction of the tracks."""
    chosen = scene.points.track % 100 < 100 * share
    xy = scene.points.xy + np.where(chosen[:, None], displacement[scene.points.frame], 0.0).astype(np.float32)
    return arrange(replace(scene.points, xy=xy), scene.intrinsics.width, scene.intrinsics.height)


def test_traffic_through_half_of_the_picture_is_not_the_camera(scene_of: Callable[..., Any]) -> None:
    traffic = 6.0 * np.arange(60)[:, None] * [1.0, 0.1]
    assert is_static(moved(scene_of("static"), traffic, 0.45))


def test_the_sway_of_a_tripod_is_standing(scene_of: Callable[..., Any]) -> None:
    sway = 1.0 * np.sin(np.arange(60))[:, None] * [1.0, 0.5]
    assert is_static(moved(scene_of("static"), sway, 1.0))


@pytest.mark.parametrize("px_per_frame", [0.15, 1.0])
def test_a_slow_drift_of_everything_is_the_camera(scene_of: Callable[..., Any], px_per_frame: float) -> None:
    drift = px_per_frame * np.arange(60)[:, None] * [1.0, 0.0]
    assert not is_static(moved(scene_of("static"), drift, 1.0))


def test_a_camera_that_stops_has_moved(scene_of: Callable[..., Any]) -> None:
    stop = np.minimum(np.arange(60), 20)[:, None] * [1.0, 0.0]
    assert not is_static(moved(scene_of("static"), stop, 1.0))


@pytest.mark.parametrize("log_zoom_and_roll", [(0.05, 0.0), (0.0, 0.05), (0.0, 0.0)])
def test_a_zoom_or_a_roll_too_slow_for_a_window_is_the_camera(
    scene_of: Callable[..., Any], log_zoom_and_roll: tuple[float, float]
) -> None:
    """The middle of the picture stays where it is."""
    scene = scene_of("static", num_frames=200)
    middle = np.array([scene.intrinsics.width, scene.intrinsics.height]) / 2
    log_zoom, roll = np.array(log_zoom_and_roll)[:, None] * scene.points.frame / 199
    turned = np.exp(log_zoom + 1j * roll) * ((scene.points.xy - middle) @ [1, 1j])
    xy = (np.stack([turned.real, turned.imag], 1) + middle).astype(np.float32)
    shot = arrange(replace(scene.points, xy=xy), scene.intrinsics.width, scene.intrinsics.height)
    assert is_static(shot) == (not any(log_zoom_and_roll))
