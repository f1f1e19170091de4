"""Both hands of one person as the hand network saw them, frame by frame."""

from dataclasses import dataclass, replace

import numpy as np

from humanmm.models.records.frame_arrays import FrameArrays

NUM_POINTS = 21
"""Wrist, then four of each finger from its base to its tip: thumb, index, middle, ring and little finger."""


@dataclass(frozen=True)
class HandTracks(FrameArrays):
    """Left (0) and right (1) hand in the N frames of a track."""

    confidence: np.ndarray
    """(N,2) float32: probability that this is the hand, of this side; 0 where it was looked for and is not to be seen,
    nan where it was not looked for."""
    points: np.ndarray
    """(N,2,21,2) float32, source pixels; zero where confidence is 0 or nan."""
    points3d: np.ndarray
    """(N,2,21,3) float32, metres about the middle of the hand, in the axes of the viewing ray through it (x right, y
    down, z away); zero where confidence is 0 or nan."""

    def scaled(self, scale: np.ndarray) -> "HandTracks":
        """In pixels of a picture whose width and height are `scale` (2,) times as large."""
        return replace(self, points=(self.points * scale).astype(np.float32))

    def with_sides_swapped(self, is_swapped: np.ndarray) -> "HandTracks":
        """Left and right exchanged in some frames."""
        arrays = []
        for values in vars(self).values():
            exchanged = values.copy()
            exchanged[is_swapped] = values[is_swapped][:, ::-1]
            arrays.append(exchanged)
        return HandTracks(*arrays)


def not_looked(num_frames: int) -> HandTracks:
    """Of a person whose hands nobody looked for."""
    return HandTracks(
        np.full((num_frames, 2), np.nan, np.float32),
        np.zeros((num_frames, 2, NUM_POINTS, 2), np.float32),
        np.zeros((num_frames, 2, NUM_POINTS, 3), np.float32),
    )
