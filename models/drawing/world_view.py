"""The world seen from the side: floor grid, shadows, paths, the shot's camera, and everybody's body; not the video.

`Overlay` draws the bodies, for a camera of our own that looks across the main direction in which people move, from the
side on which the video's camera stands. Places that nothing links are seen one at a time, each by its own camera.
"""

import dataclasses
from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from humanmm.models.drawing import palette
from humanmm.models.drawing.canvas import Canvas
from humanmm.models.drawing.overlay import OPACITY, Overlay
from humanmm.models.geometry import projection
from humanmm.models.geometry.intrinsics import K_from_focal
from humanmm.models.geometry.rotations import unit
from humanmm.models.records.recording import RecordedPerson, Recording
from humanmm.models.video.colors import BT601, Colors

SKY: palette.RGB = (25, 29, 35)
FLOOR: palette.RGB = (44, 50, 58)
GRID: palette.RGB = (74, 82, 94)
_FIELD = 0.62
"""Half of the picture's longer side over the distance."""
_EYE_OVER_TARGET_M = 0.9
_HEAD_ROOM_M = 0.5
"""Over the highest head, for its number."""
_ROOM_M = 1.0
"""Around the path of a root."""
_FARTHEST_M = 4.0
"""Half of what is seen at most: a longer path is followed."""
_SMOOTH_S = 1.0
_REACH_M = 12
_ALONG = np.arange(-_REACH_M, _REACH_M + 1.0)
_GRID = np.stack(
    [
        np.stack([np.stack([_ALONG, np.full_like(_ALONG, end)], 1)[:, ::way] for end in (-_REACH_M, _REACH_M)], 1)
        for way in (1, -1)
    ]
).reshape(-1, 2, 2)
"""(lines,2,2) ends of the grid's lines on the floor, around a corner of it."""
_CAMERA_M, _CAMERA_FROM_M = 0.5, 2.5
"""Width of the camera's picture; a camera nearer to the eye would cover the people."""
_NEAR_M = 0.3
_SUN = np.array([0.45, 0.35, 1.0])
"""Direction to the light."""
_SHADOW = 0.4
_BONES = (
    (0, 9, 0.13), (9, 15, 0.09), (15, 15, 0.12), (16, 18, 0.05), (18, 20, 0.045), (20, 22, 0.04), (17, 19, 0.05),
    (19, 21, 0.045), (21, 23, 0.04), (1, 4, 0.08), (4, 7, 0.06), (7, 10, 0.05), (2, 5, 0.08), (5, 8, 0.06),
    (8, 11, 0.05), (16, 17, 0.08),
)  # fmt: skip
"""Joints between which a shadow falls, and its half width in metres."""


@dataclasses.dataclass(frozen=True)
class FloorPath:
    """Where somebody's root is on the floor; N rows."""

    frame: np.ndarray
    points: Float[np.ndarray, "N 3"]
    color: palette.RGB


class WorldView:
    """Draws pictures of width × height (even); one thread at a time. `place_of_shot` numbers the places of shots."""

    def __init__(
        self,
        recording: Recording,
        place_of_shot: Sequence[int],
        width: int,
        height: int,
        colors: Colors = BT601,
        *,
        opacity: float = OPACITY,
    ) -> None:
        self._recording = recording
        self._size = width, height
        self._place = np.array(place_of_shot, np.int32)[recording.shot_index]
        self._seen = self._side_cameras()
        self._bodies = Overlay(self._seen, (), width, height, colors, opacity=opacity)
        self._paths = [
            FloorPath(p.frame, np.column_stack([p.pelvis[:, :2], np.zeros(len(p.frame))]), palette.person_color(p))
            for p in recording.people
        ]
        self._empty = np.empty((height * 3 // 2, width), np.uint8)
        self._paint_background(Canvas(self._empty, colors))
        self._colors = colors

    def draw(self, image: UInt8[np.ndarray, "HplusHalf W"], frame: int) -> None:
        """Draw the world of one frame over the whole of a picture's planes (as `Canvas` takes them)."""
        image[...] = self._empty
        canvas = Canvas(image, self._colors)
        self._draw_grid(canvas, frame)
        for person in self._recording.people:
            self._draw_shadow(canvas, frame, person)
        for path in self._paths:
            self._draw_path(canvas, frame, path)
        self._draw_camera(canvas, frame)
        self._bodies.draw_people(canvas, frame)

    # ---- the eye

    def _side_cameras(self) -> Recording:
        """The recording with cameras of ours, and places instead of shots: `Overlay` shows whom a place shows."""
        recording, (width, height) = self._recording, self._size
        focal = max(width, height) / 2 / _FIELD
        K = K_from_focal(focal, width, height).astype(np.float32)
        R, t = np.empty((recording.num_frames, 3, 3)), np.empty((recording.num_frames, 3))
        for place in np.unique(self._place):
            frames = np.flatnonzero(self._place == place)
            R[frames], t[frames] = self._side_camera(frames, focal)
        return dataclasses.replace(
            recording, width=width, height=height, R_world_cam=R.astype(np.float32), t_world_cam=t.astype(np.float32),
            K=np.broadcast_to(K, (recording.num_frames, 3, 3)), shot_index=self._place,
        )  # fmt: skip

    def _side_camera(self, frames: np.ndarray, focal: float) -> tuple[np.ndarray, np.ndarray]:
        """Rotation (camera to world), and its centre in each of some frames."""
        roots = self._roots(frames)
        camera = self._recording.t_world_cam[frames, :2].astype(np.float64)
        looks = self._recording.R_world_cam[frames[0], :2, 2].astype(np.float64)
        everybody = np.concatenate([*roots.values()]) if roots else camera + looks
        middle = (everybody.min(axis=0) + everybody.max(axis=0)) / 2
        along = _main_direction(everybody - middle)
        if np.ptp(everybody @ along) < 2 * _ROOM_M:  # nobody goes anywhere: across the video's camera
            along = unit(looks) if np.linalg.norm(looks) > 0.1 else np.array([1.0, 0])
        across = np.array([-along[1], along[0]])
        if (camera.mean(axis=0) - middle) @ across > 0:
            across = -across
        half, depth = np.ptp(everybody @ along) / 2 + _ROOM_M, np.ptp(everybody @ across) / 2 + _ROOM_M
        follows = half > _FARTHEST_M
        target = self._smooth_middle(frames, roots, middle) if follows else np.tile(middle, (len(frames), 1))
        width, height = self._size
        top = self._highest(frames) + _HEAD_ROOM_M
        distance = max(min(half, _FARTHEST_M) * 2 * focal / width, 1.2 * top * focal / height) + depth
        forward = unit(np.array([*(across * distance), -_EYE_OVER_TARGET_M]))
        right = unit(np.cross(forward, [0, 0, 1.0]))
        centre = np.column_stack([target - across * distance, np.full(len(frames), top / 2 + _EYE_OVER_TARGET_M)])
        return np.stack([right, np.cross(forward, right), forward], axis=1), centre

    def _roots(self, frames: np.ndarray) -> dict[int, np.ndarray]:
        """Number of each person → (n,2) where he was seen in some frames."""
        seen = {p.person: p.pelvis[np.isin(p.frame, frames) & p.observed, :2] for p in self._recording.people}
        return {person: points.astype(np.float64) for person, points in seen.items() if len(points)}

    def _highest(self, frames: np.ndarray) -> float:
        """Height of the highest joint that was seen in some frames."""
        rows = [p.joints[np.isin(p.frame, frames) & p.observed] for p in self._recording.people]
        return max((float(joints[..., 2].max()) for joints in rows if len(joints)), default=1.7)

    def _smooth_middle(self, frames: np.ndarray, roots: dict[int, np.ndarray], middle: np.ndarray) -> np.ndarray:
        """(n,2) between those who were seen, averaged over a second."""
        total, count = np.zeros((len(frames), 2)), np.zeros((len(frames), 1))
        for person in self._recording.people:
            rows = np.isin(person.frame, frames) & person.observed & (person.person in roots)
            at = np.searchsorted(frames, person.frame[rows])
            total[at] += person.pelvis[rows, :2]
            count[at] += 1
        known = np.flatnonzero(count[:, 0])
        if not len(known):
            return np.tile(middle, (len(frames), 1))
        means = total[known] / count[known]
        filled = np.stack([np.interp(np.arange(len(frames)), known, means[:, k]) for k in range(2)], axis=1)
        reach = max(1, round(self._recording.fps * _SMOOTH_S / 2))
        padded = np.pad(filled, ((reach, reach), (0, 0)), mode="edge")
        sums = np.cumsum(np.pad(padded, ((1, 0), (0, 0))), axis=0)
        return np.asarray((sums[2 * reach + 1 :] - sums[: -2 * reach - 1]) / (2 * reach + 1))

    def _project(self, frame: int, points: Float[np.ndarray, "P 3"]) -> Float[np.ndarray, "P 2"] | None:
        """Pixels of world points, None if one of them is not in front of the eye."""
        in_camera = projection.world_to_camera(points, self._seen.R_world_cam[frame], self._seen.t_world_cam[frame])
        if len(points) == 0 or not projection.in_front(in_camera, _NEAR_M).all():
            return None
        return projection.project(in_camera, self._seen.K[frame], near_m=_NEAR_M)

    # ---- what is drawn

    def _paint_background(self, canvas: Canvas) -> None:
        """Sky and floor, the floor darker towards the horizon."""
        forward, K = self._seen.R_world_cam[0, :, 2], self._seen.K[0]
        horizon = int(K[1, 2] + K[1, 1] * forward[2] / np.hypot(forward[0], forward[1]))
        canvas.rectangle(0, 0, canvas.width, canvas.height, SKY)
        bands = 24
        for band in range(bands):
            top = horizon + (canvas.height - horizon) * band / bands
            share = min(1.0, (band + 1) / bands * 1.8)
            color = tuple(round(s + (f - s) * share) for s, f in zip(SKY, FLOOR, strict=True))
            canvas.rectangle(0, round(top), canvas.width, canvas.height, (color[0], color[1], color[2]))

    def _draw_grid(self, canvas: Canvas, frame: int) -> None:
        """Lines at every metre around what the eye looks at, where they lie in front of it."""
        R, t = self._seen.R_world_cam[frame].astype(np.float64), self._seen.t_world_cam[frame].astype(np.float64)
        ahead = t[:2] + R[:2, 2] * (t[2] / max(-R[2, 2], 0.05)) * 0.5
        ends = (np.floor(ahead) + _GRID - t[:2]) @ R[:2] - t[2] * R[2]  # (lines,2,3) in camera axes
        depth = ends[..., 2] - _NEAR_M
        ends, depth = ends[(depth > 0).any(axis=1)], depth[(depth > 0).any(axis=1)]
        share = (depth[:, 0] / np.where(depth[:, 0] == depth[:, 1], 1, depth[:, 0] - depth[:, 1]))[:, None, None]
        ends = np.where(depth[..., None] < 0, ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * share, ends)
        canvas.lines(list(projection.project(ends, self._seen.K[frame], near_m=_NEAR_M)), GRID)

    def _draw_shadow(self, canvas: Canvas, frame: int, person: RecordedPerson) -> None:
        """Limbs as strokes on the floor, away from the light."""
        row = frame - int(person.frame[0]) if len(person.frame) else -1
        if not 0 <= row < len(person.frame) or not self._is_in_place(person, frame):
            return
        joints = person.joints[row].astype(np.float64)
        joints[:, 2] = np.maximum(joints[:, 2], 0)
        pixels = self._project(frame, joints - joints[:, 2:] / _SUN[2] * _SUN)
        if pixels is None:
            return
        scale = self._seen.K[frame, 0, 0] / np.linalg.norm(person.pelvis[row] - self._seen.t_world_cam[frame])
        low = np.floor(pixels.min(axis=0) - 0.2 * scale).astype(int)
        size = np.ceil(pixels.max(axis=0) + 0.2 * scale).astype(int) - low
        low, high = np.maximum(low, 0), np.minimum(low + size, self._size)
        if (high <= low).any():
            return
        mask = np.zeros((high[1] - low[1], high[0] - low[0]), np.uint8)
        corners = np.rint((pixels - low - 0.5) * 16).astype(np.int32)
        for a, b, radius in _BONES:
            thickness = max(1, round(1.2 * radius * scale))  # seen from low, a stroke is narrower than it is long
            cv2.line(mask, corners[a].tolist(), corners[b].tolist(), 255, thickness, cv2.LINE_AA, 4)
        mask = cv2.blur(mask, (5, 3))
        canvas.stamp(int(low[0]), int(low[1]), cv2.convertScaleAbs(mask, alpha=_SHADOW), palette.INK)

    def _is_in_place(self, person: RecordedPerson, frame: int) -> bool:
        return bool((self._place[person.frame[person.observed]] == self._place[frame]).any())

    def _draw_path(self, canvas: Canvas, frame: int, path: FloorPath) -> None:
        """The path of a root in this place, up to this frame."""
        rows = (path.frame <= frame) & (self._place[path.frame] == self._place[frame])
        points = path.points[rows]
        pixels = self._project(frame, points[:: max(1, len(points) // 400)])
        if pixels is not None and len(pixels) > 1:
            canvas.lines([pixels], path.color, 2)

    def _draw_camera(self, canvas: Canvas, frame: int) -> None:
        """The pyramid of the video's camera."""
        recording = self._recording
        K, R = recording.K[frame].astype(np.float64), recording.R_world_cam[frame].astype(np.float64)
        width, height = recording.width, recording.height
        corners = np.array([[0, 0, 1], [width, 0, 1], [width, height, 1], [0, height, 1]], np.float64)
        rays = corners @ np.linalg.inv(K).T * (_CAMERA_M * K[0, 0] / width)
        centre = recording.t_world_cam[frame].astype(np.float64)
        if (centre - self._seen.t_world_cam[frame]) @ self._seen.R_world_cam[frame, :, 2] < _CAMERA_FROM_M:
            return
        pixels = self._project(frame, np.concatenate([centre[None], centre + rays @ R.T]))
        if pixels is None or np.abs(pixels).max() > 8 * max(self._size):
            return
        color = palette.shot_color(int(recording.shot_index[frame]))
        canvas.lines([pixels[[1, 2, 3, 4, 1]], *(pixels[[0, k]] for k in range(1, 5))], color, 2)


def _main_direction(points: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " 2"]:
    """Along which points on the floor lie."""
    _, _, axes = np.linalg.svd(points, full_matrices=False)
    return np.asarray(axes[0])
