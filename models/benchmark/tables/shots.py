"""The table of shot detection (paper, ablation on the shot transition detector): its parts added one by one."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from humanmm.models.benchmark.tables.rows import RESAMPLES, Metric, Row, summarise
from humanmm.models.evaluation.cuts import score_cuts
from humanmm.models.records.shots import Scenes
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.shot_detection.people_cuts import Parts, split_scenes

DETECTORS: Mapping[str, Parts] = {
    "humanmm without boxes and keypoints": "scenes",
    "humanmm without keypoints": "boxes",
    "humanmm": "keypoints",
}
"""Method of the table → how much of the detector it is."""
FIGURES = (
    "cut_recall", "cut_precision", "cut_f1", "pooled_cut_recall", "pooled_cut_precision", "pooled_cut_f1", "cuts",
    "false_cuts", "missed_cuts",
)  # fmt: skip


@dataclass(frozen=True)
class CutCounts:
    """One detector on one video."""

    true: int
    found: int
    matched: int

    @property
    def figures(self) -> tuple[float, float, float]:
        """Recall, precision, F1; nothing to find and nothing found is perfect."""
        if not self.true and not self.found:
            return 1.0, 1.0, 1.0
        recall, precision = self.matched / max(self.true, 1), self.matched / max(self.found, 1)
        return recall, precision, 2 * self.matched / (self.true + self.found)


def count_cuts(
    scenes: Scenes,
    people: Sequence[ScenePeople],
    truth: Sequence[tuple[int, int]],
    *,
    time_s: Float[np.ndarray, " F"],
) -> dict[str, CutCounts]:
    """Every detector on one video, by method."""
    counts = {}
    for method, parts in DETECTORS.items():
        split = split_scenes(scenes, people, time_s=time_s, parts=parts)
        found = [transition.cut_frame for transition in split.transitions]
        matched = round(score_cuts(found, truth).precision * len(found))
        counts[method] = CutCounts(len(truth), len(found), matched)
    return counts


def rows_of_cuts(split: str, counted: Sequence[Mapping[str, CutCounts] | None]) -> list[Row]:
    """A row for each detector; None stands for a video that failed.

    Recall, precision and F1 are means over videos, `pooled_…` are of all cuts together; the intervals of both are
    bootstrapped over videos.
    """
    good = [counts for counts in counted if counts is not None]
    rows = []
    for method in DETECTORS:
        counts = [video[method] for video in good]
        metrics: dict[str, Metric] = {}
        if counts:
            samples = np.array([count.figures for count in counts])
            metrics |= {key: summarise(samples[:, k].tolist()) for k, key in enumerate(FIGURES[:3])}
            metrics |= _pooled(counts)
            metrics["cuts"] = summarise([float(count.true) for count in counts])
            metrics["false_cuts"] = summarise([float(count.found - count.matched) for count in counts])
            metrics["missed_cuts"] = summarise([float(count.true - count.matched) for count in counts])
        rows.append(Row(method, split, len(counted), len(counted) - len(good), metrics))
    return rows


def _pooled(counts: Sequence[CutCounts]) -> dict[str, Metric]:
    table = np.array([(count.true, count.found, count.matched) for count in counts])
    drawn = np.random.default_rng(0).integers(0, len(table), (RESAMPLES, len(table)))
    resampled = np.array([CutCounts(*total).figures for total in table[drawn].sum(axis=1).tolist()])
    whole = CutCounts(*table.sum(axis=0).tolist()).figures
    low, high = np.percentile(resampled, [2.5, 97.5], axis=0)
    middle = np.median(resampled, axis=0)
    return {
        key: Metric(whole[k], float(middle[k]), (float(low[k]), float(high[k]))) for k, key in enumerate(FIGURES[3:6])
    }
