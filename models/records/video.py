"""What is known of a video once every frame has been found to decode."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class VideoFacts:
    """Container facts and exact frame times. Width and height belong to the upright picture (rotation applied)."""

    width: int
    height: int
    time_s: np.ndarray
    """(F,) float64, presentation time of each decodable frame, first frame's own time kept, strictly increasing."""
    keyframe: np.ndarray
    """(F,) bool, true where decoding can start."""
    rotation_deg: int
    """Clockwise rotation that makes the stored picture upright: 0, 90, 180, 270."""
    codec: str
    container: str
    warnings: tuple[str, ...] = ()
    """One sentence each, e.g. for a truncated file."""
    mirrored: bool = False
    """The stored picture is also flipped left to right, before the rotation."""
    counted: bool = False
    """Time stamps do not name the pictures (AVI with B-frames): frames are found by counting from the first."""

    @property
    def num_frames(self) -> int:
        return len(self.time_s)

    @property
    def fps(self) -> float:
        """Mean frame rate, Hz; 0 for a single frame."""
        return mean_rate_hz(self.time_s)


def mean_rate_hz(time_s: np.ndarray) -> float:
    """(F − 1) / (last time − first time) of F frame times, Hz; 0 for a single frame."""
    span = float(time_s[-1] - time_s[0]) if len(time_s) > 1 else 0.0
    return (len(time_s) - 1) / span if span > 0 else 0.0
