"""The camera of one shot: what a camera estimator takes and returns, and its run on a shot's part of the scene."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

from humanmm.models.camera.estimate import camera_from_points
from humanmm.models.camera.given import checked, given_camera
from humanmm.models.camera.shot_points import points_of_shot
from humanmm.models.records.camera import Intrinsics, PointTracks, ShotCamera
from humanmm.models.records.shots import Shot
from humanmm.models.records.tracks import PersonTrack, ScenePeople
from humanmm.models.video.progress import Progress, silent


class CameraEstimator(Protocol):
    """Estimates the camera of one shot from tracked points."""

    def __call__(
        self,
        points: PointTracks,
        people: Sequence[PersonTrack],
        intrinsics: Intrinsics,
        *,
        static: bool,
        progress: Progress = silent,
    ) -> ShotCamera:
        """Camera of every frame of [points.start, points.end), in the axes of the shot's first camera.

        `points`: of this shot's clear frames alone, on people too; `people`: tracks of its scene; `static`: the
        user says that the camera is static.
        """
        ...


def estimate_camera(
    shot: Shot,
    points: PointTracks,
    people: ScenePeople,
    intrinsics: Intrinsics,
    *,
    static: bool = False,
    estimator: CameraEstimator = camera_from_points,
    progress: Progress = silent,
) -> ShotCamera:
    """Camera of every frame of a shot, in the axes of its first camera, from the points and people of its scene.

    `static`: the user says that the camera is static. Where he gives the cameras themselves, nothing is estimated,
    but they are held against the points.
    """
    intrinsics = intrinsics.of_shot(shot.start, shot.end)
    given = given_camera(shot, intrinsics)
    if given is not None and not static:
        return checked(given, shot, intrinsics, points_of_shot(points, shot), people.tracks)
    camera = estimator(points_of_shot(points, shot), people.tracks, intrinsics, static=static, progress=progress)
    if intrinsics.cameras is None or static:
        return camera
    said = f"the given cameras do not cover it (frames {shot.start} to {shot.end - 1}): its camera was estimated"
    return replace(camera, warnings=(said, *camera.warnings))
