"""Rows of a table: what many videos' figures come to, per method and split."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from jaxtyping import Int

from humanmm.models.benchmark.scores import MethodFigures, VideoFigures

RESAMPLES = 2000

ANGLES_DEG = (0, 60, 120, 150, 180)
"""Bounds of the groups of cut angles."""
ALL = "all"
"""The split that holds all videos of a set."""


@dataclass(frozen=True)
class Metric:
    """One figure over the samples of a row."""

    mean: float
    median: float
    ci95: tuple[float, float]
    """Bootstrap interval of the mean."""
    p90: float | None = None
    """What nine in ten samples do not exceed; None where the figure is not of samples."""


@dataclass(frozen=True)
class Row:
    """One method on one split."""

    method: str
    split: str
    n: int
    """All videos, also those that failed."""
    failed: int
    metrics: Mapping[str, Metric]
    """Over the videos that did not fail."""


def exact(value: float) -> Metric:
    """A figure that is counted, not sampled."""
    return Metric(value, value, (value, value))


def summarise(samples: Sequence[float]) -> Metric:
    """Mean, median, and the bootstrap's 95 % interval of the mean (fixed seed; one sample is its own interval)."""
    values = np.asarray(samples, np.float64)
    low, high = np.percentile(values[_drawn(len(values))].mean(axis=1), [2.5, 97.5])
    p90 = float(np.percentile(values, 90))
    return Metric(float(values.mean()), float(np.median(values)), (float(low), float(high)), p90)


@lru_cache(maxsize=32)
def _drawn(num_samples: int) -> Int[np.ndarray, "resamples samples"]:
    """Which samples make up each resample: the same for all figures of as many videos."""
    return np.random.default_rng(0).integers(0, num_samples, (RESAMPLES, num_samples))


def rows_of(videos: Sequence[VideoFigures]) -> list[Row]:
    """A row for every method on every split, and on all of them together where there are several."""
    splits = list(dict.fromkeys(video.split for video in videos))
    rows = []
    for split in [*splits, *([ALL] if len(splits) > 1 else [])]:
        chosen = [video for video in videos if split in (ALL, video.split)]
        for method in dict.fromkeys(one.method for video in chosen for one in video.methods):
            rows.append(_row(method, split, [one for video in chosen for one in video.methods if one.method == method]))
    return rows


def _row(method: str, split: str, done: Sequence[MethodFigures]) -> Row:
    good = [one for one in done if not one.failure]
    samples: dict[str, list[float]] = {}
    for one in good:
        for figure in one.figures:
            samples.setdefault(figure.name, []).append(figure.value)
    cuts = [cut for one in good for cut in one.cuts]
    for low, high in pairwise(ANGLES_DEG):
        end = high if high < ANGLES_DEG[-1] else 181  # 180° belongs to the last group
        found = [cut.error_deg for cut in cuts if cut.error_deg is not None and low <= cut.angle_deg < end]
        if found:
            samples[angle_key(low, high)] = found
    metrics = {name: summarise(values) for name, values in samples.items()}
    return Row(method, split, len(done), len(done) - len(good), metrics)


def angle_key(low: int, high: int) -> str:
    """Name of the camera's error at cuts of some angle."""
    return f"cam_cut_rot_deg_at_{low}_{high}"
