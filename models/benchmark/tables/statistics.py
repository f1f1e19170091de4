"""A set of videos in numbers, as the paper's data table gives them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class SetStatistics:
    """Mean duration in seconds, number of videos, frames a second, longest and shortest in frames, transitions."""

    duration_s: float
    videos: int
    fps: float
    longest: int
    shortest: int
    transitions: tuple[int, ...]

    def sentence(self) -> str:
        """One line, figures in the order of the paper's table."""
        counts = ", ".join(map(str, self.transitions))
        return (
            f"mean duration {self.duration_s:.1f} s, {self.videos} videos, {self.fps:g} fps, longest {self.longest} "
            f"frames, shortest {self.shortest}, transitions {counts} "
            "(paper: 23.7 s, 600 videos, 30 fps, longest 1478, shortest 314, transitions 2, 3, 4)"
        )


def statistics_of(lengths: Sequence[int], fps: Sequence[float], transitions: Sequence[int]) -> SetStatistics:
    """The numbers of a set, from each video's frames, rate and number of transitions."""
    frames, rates = np.array(lengths), np.array(fps)
    return SetStatistics(
        duration_s=float((frames / rates).mean()),
        videos=len(frames),
        fps=float(np.median(rates)),
        longest=int(frames.max()),
        shortest=int(frames.min()),
        transitions=tuple(sorted(set(transitions))),
    )
