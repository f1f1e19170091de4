"""The background points of one shot, arranged for geometry: recorded images, compact point numbers, centred pixels."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from humanmm.models.camera.odometry.bundle import Observations
from humanmm.models.geometry.intrinsics import straightened
from humanmm.models.records.camera import PointTracks

KEYFRAME_MOVE_FRACTION = 0.03
"""Median image motion since the last keyframe, as a fraction of the picture's diagonal, that makes the next one."""
KEYFRAME_SHARED_FRACTION = 0.6
"""Fraction of the last keyframe's points that must still be seen; below it the next keyframe comes."""
MAX_KEYFRAME_GAP = 15
MIN_KEYFRAMES = 10
"""Short shots take keyframes more densely, to have about this many."""


@dataclass(frozen=True)
class TrackedShot:
    """Sightings sorted by image, then by point; image i is the recorded frame `frame[i]`."""

    start: int
    end: int
    width: int
    height: int
    frame: Int[np.ndarray, " images"]
    begins: Int[np.ndarray, " images+1"]
    """Sightings of image i are [begins[i], begins[i + 1])."""
    sightings: Observations
    num_points: int

    @property
    def num_images(self) -> int:
        return len(self.frame)

    @property
    def diagonal_px(self) -> float:
        return float(np.hypot(self.width, self.height))

    def seen(self, image: int) -> tuple[Int[np.ndarray, " n"], Float[np.ndarray, "n 2"]]:
        """Points (ascending) and centred pixels of one image."""
        part = slice(self.begins[image], self.begins[image + 1])
        return self.sightings.point[part], self.sightings.xy[part].astype(float)

    def shared(
        self, a: int, b: int
    ) -> tuple[Int[np.ndarray, " n"], Float[np.ndarray, "n 2"], Float[np.ndarray, "n 2"]]:
        """Points seen in both images, with their pixels in each."""
        point_a, xy_a = self.seen(a)
        point_b, xy_b = self.seen(b)
        point, in_a, in_b = np.intersect1d(point_a, point_b, assume_unique=True, return_indices=True)
        return point, xy_a[in_a], xy_b[in_b]

    def of_images(self, images: Int[np.ndarray, " k"]) -> Observations:
        """Sightings in these images only, renumbered 0..k−1 in the given order."""
        parts = [np.arange(self.begins[i], self.begins[i + 1]) for i in images]
        index = np.concatenate(parts) if parts else np.zeros(0, int)
        number = np.repeat(np.arange(len(images)), [len(part) for part in parts])
        point, xy = self.sightings.point[index], self.sightings.xy[index]
        return Observations(number, point.astype(int), xy.astype(float))


def arrange(points: PointTracks, width: int, height: int, *, distortion: float = 0.0) -> TrackedShot:
    """Sort the observations, as a pinhole camera would see them (`straightened`), and drop points seen only once."""
    lifetimes = np.bincount(points.track) if len(points.track) else np.zeros(0, int)
    keep = lifetimes[points.track] >= 2 if len(points.track) else np.zeros(0, bool)
    track, frame, xy = points.track[keep], points.frame[keep], points.xy[keep]
    order = np.lexsort((track, frame))
    frames, begins = np.unique(frame[order], return_index=True)
    numbers = np.cumsum(np.bincount(track) > 0) - 1 if len(track) else np.zeros(0, int)
    point = numbers[track[order]].astype(np.int32)
    image = np.repeat(np.arange(len(frames), dtype=np.int32), np.diff([*begins, len(order)]))
    centred = straightened(xy[order], distortion, width, height) - np.array([width / 2, height / 2], np.float32)
    num_points = int(point.max()) + 1 if len(point) else 0
    return TrackedShot(
        points.start, points.end, width, height, frames.astype(int), np.append(begins, len(order)).astype(int),
        Observations(image, point, centred), num_points,
    )  # fmt: skip


def choose_keyframes(shot: TrackedShot) -> Int[np.ndarray, " k"]:
    """Images for the bundle adjustment, first and last included: as many as the picture's motion needs."""
    if shot.num_images <= 2:
        return np.arange(shot.num_images)
    threshold = KEYFRAME_MOVE_FRACTION * shot.diagonal_px
    longest = max(1, min(MAX_KEYFRAME_GAP, shot.num_images // MIN_KEYFRAMES))
    chosen = [0]
    for image in range(1, shot.num_images):
        last = chosen[-1]
        point, there, here = shot.shared(last, image)
        few = len(point) < KEYFRAME_SHARED_FRACTION * (shot.begins[last + 1] - shot.begins[last])
        moved = float(np.median(np.linalg.norm(here - there, axis=1))) if len(point) else np.inf
        if few or moved > threshold or image - last >= longest:
            chosen.append(image)
    if chosen[-1] != shot.num_images - 1:
        chosen.append(shot.num_images - 1)
    return np.array(chosen)
