"""What the oracle methods take from the truth: cuts, cameras, or the rotation about the vertical at every cut."""

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace

import numpy as np
from jaxtyping import Float

from humanmm.errors import StageError
from humanmm.models.geometry.boxes import box_iou
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.records.camera import PointTracks, ShotCamera
from humanmm.models.records.motion import WorldMotion
from humanmm.models.records.sequence import CameraSequence
from humanmm.models.records.shots import Scenes, ShotList, Transition
from humanmm.models.records.tracks import PersonTrack, ScenePeople
from humanmm.models.synthetic.multishot import BenchVideo

Array = np.ndarray

SAME_IOU = 0.3
"""Least IoU of the boxes on both sides of a false cut for two tracks to be one person's."""


def true_rotations(video: BenchVideo, shots: ShotList) -> Mapping[int, Float[Array, "3 3"]]:
    """By first frame of a shot: true camera axes of that frame to those of the frame before."""
    R = _known(video).R_world_cam
    return {shot.start: R[shot.start - 1].T @ R[shot.start] for shot in shots.shots[1:]}


def yaw_rotations(video: BenchVideo, shots: ShotList, world: WorldMotion) -> Mapping[int, Float[Array, "3 3"]]:
    """Camera rotations of `world` at its cuts, each with its part about the vertical replaced by the true one."""
    rotations = {}
    for start, true in true_rotations(video, shots).items():
        before, after = world.R_world_cam[start - 1], world.R_world_cam[start]
        missing = before @ true @ after.T
        yaw = float(np.arctan2(missing[1, 0] - missing[0, 1], missing[0, 0] + missing[1, 1]))
        rotations[start] = before.T @ rotvec_to_rotmat(np.array([0.0, 0.0, yaw])) @ after
    return rotations


def true_cameras(video: BenchVideo, shots: ShotList) -> tuple[ShotCamera, ...]:
    """The true camera of every shot, with its path in metres and its K."""
    cameras = _known(video)
    found = []
    for shot in shots.shots:
        frames = slice(shot.start, shot.end)
        R, t = cameras.R_world_cam[frames], cameras.t_world_cam[frames]
        found.append(
            ShotCamera(
                start=shot.start,
                end=shot.end,
                R_shot_cam=R[0].T @ R,
                t_shot_cam=(t - t[0]) @ R[0],
                K=cameras.K[frames],
                source="given",
                metric=True,
                reprojection_px=float("nan"),
            )
        )
    return tuple(found)


def with_true_cuts(video: BenchVideo) -> BenchVideo:
    """The same observations, sorted into the truth's scenes; no other cut is looked for."""
    transitions = tuple(
        Transition("cut" if start == end else "dissolve", start, end, "truth") for start, end in video.truth.transitions
    )
    scenes = Scenes(video.scenes.num_frames, transitions)
    return replace(
        video,
        scenes=scenes,
        people=tuple(ScenePeople(start, end, _tracks(video.people, start, end)) for start, end in scenes.spans),
        points=tuple(_points(video.points, start, end) for start, end in scenes.spans),
        cuts_known=True,
    )


def _known(video: BenchVideo) -> CameraSequence:
    cameras = video.truth.cameras
    if cameras is None or not all(np.isfinite(getattr(cameras, field.name)).all() for field in fields(cameras)):
        raise StageError("the truth does not know the camera of every frame")
    return cameras


def _tracks(scenes: Sequence[ScenePeople], start: int, end: int) -> tuple[PersonTrack, ...]:
    """The tracks between two frames; where a scene ends in between, who stays there goes on."""
    tracks: list[PersonTrack] = []
    for scene in scenes:
        if scene.end <= start or scene.start >= end:
            continue
        earlier = list(range(len(tracks)))
        for piece in (track.within(start, end) for track in scene.tracks):
            if not len(piece.frame):
                continue
            overlaps = [(float(box_iou(tracks[k].bbox[-1], piece.bbox[0])), k) for k in earlier]
            best, k = max(overlaps, default=(0.0, -1))
            if best >= SAME_IOU:
                tracks[k] = tracks[k].then(piece)
                earlier.remove(k)
            else:
                tracks.append(piece)
    return tuple(tracks)


def _points(scenes: Sequence[PointTracks], start: int, end: int) -> PointTracks:
    """Point tracks between two frames; tracks of different scenes stay different."""
    parts = [points for points in scenes if points.start < end and points.end > start]
    offsets = np.cumsum([0, *(int(points.track.max(initial=-1)) + 1 for points in parts)])
    inside = [(points.frame >= start) & (points.frame < end) for points in parts]

    def joined(name: str) -> Array:
        return np.concatenate([getattr(points, name)[rows] for points, rows in zip(parts, inside, strict=True)])

    numbers = [points.track[rows] + offset for points, rows, offset in zip(parts, inside, offsets, strict=False)]
    return PointTracks(
        start, end, np.concatenate(numbers).astype(np.int32), joined("frame"), joined("xy"), joined("confidence"),
        window_px=max(points.window_px for points in parts), rate_hz=parts[0].rate_hz,
    )  # fmt: skip
