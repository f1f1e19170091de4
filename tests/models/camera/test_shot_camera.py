"""An estimator sees the points of its own shot alone, in its clear frames."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from humanmm.models.camera.estimate import camera_from_points
from humanmm.models.camera.shot_camera import estimate_camera
from humanmm.models.records.camera import Intrinsics, PointTracks, ShotCamera
from humanmm.models.records.shots import Shot, Transition
from humanmm.models.records.tracks import PersonTrack, ScenePeople
from humanmm.models.video.progress import Progress, silent


def test_another_estimator_gets_the_shots_own_points(scene_of: Callable[..., Any]) -> None:
    scene = scene_of("pan")
    dissolve = Transition("dissolve", 15, 25, "scene")
    shot = Shot(1, 20, 60, 0, dissolve, ())
    seen: list[PointTracks] = []

    def estimator(
        points: PointTracks,
        people: Sequence[PersonTrack],
        intrinsics: Intrinsics,
        *,
        static: bool,
        progress: Progress = silent,
    ) -> ShotCamera:
        seen.append(points)
        return camera_from_points(points, people, intrinsics, static=static, progress=progress)

    camera = estimate_camera(shot, scene.points, ScenePeople(0, 60, ()), scene.intrinsics, estimator=estimator)
    assert (camera.start, camera.end) == (20, 60) and camera.source == "rotation_only"
    assert seen[0].frame.min() == 22 and seen[0].frame.max() == 59


def test_a_camera_that_the_user_calls_static_is_static(scene_of: Callable[..., Any]) -> None:
    scene = scene_of("pan")
    shot = Shot(0, 0, 60, 0, None, ())
    camera = estimate_camera(shot, scene.points, ScenePeople(0, 60, ()), scene.intrinsics, static=True)
    assert camera.source == "given"
    np.testing.assert_array_equal(camera.R_shot_cam, np.tile(np.eye(3), (60, 1, 1)))
