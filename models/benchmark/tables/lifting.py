"""Errors of landmarks in space by lifter, as rows and a table."""

from collections.abc import Mapping, Sequence
from dataclasses import fields

import numpy as np

from humanmm.models.benchmark.tables.rows import ALL, Metric, Row, summarise
from humanmm.models.evaluation.landmarks import LandmarkErrors
from humanmm.models.records.table import Table

FIGURES = {
    "pa_mpjpe_mm": "PA-MPJPE, mm", "mpjpe_mm": "MPJPE about the mid-hip, mm",
    "across_mm": "of PA-MPJPE across the ray", "along_mm": "along it",
}  # fmt: skip
"""Figures of `LandmarkErrors`, and what they are called."""

Lifters = Mapping[str, Sequence[LandmarkErrors]]
"""By lifter, every track."""


def lifting_rows(lifters: Lifters, *, failed: int) -> list[Row]:
    """A row a lifter; `n` tracks, the figures over their frames."""
    return [Row(name, ALL, len(tracks) + failed, failed, _metrics(tracks)) for name, tracks in lifters.items()]


def lifting_table(lifters: Lifters) -> Table:
    """A line a lifter: median and mean over all frames."""
    head = ("median, mean", "tracks", "frames", *FIGURES.values())
    lines = []
    for name, tracks in lifters.items():
        metrics = _metrics(tracks)
        frames = sum(len(track.mpjpe_mm) for track in tracks)
        cells = (f"{metrics[key].median:.1f}, {metrics[key].mean:.1f}" if key in metrics else "" for key in FIGURES)
        lines.append((name, str(len(tracks)), str(frames), *cells))
    return Table(head, tuple(lines), "Landmarks in space")


def _metrics(tracks: Sequence[LandmarkErrors]) -> dict[str, Metric]:
    if not tracks:
        return {}
    names = [one.name for one in fields(LandmarkErrors)]
    return {name: summarise(np.concatenate([getattr(track, name) for track in tracks]).tolist()) for name in names}
