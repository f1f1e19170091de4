"""How a motion table is shown: a part for every split, the paper's own numbers beside ours, charts for the page."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from humanmm.models.benchmark.rows import ANGLES_DEG, Metric, Row, angle_key

MAIN = (
    "pa_mpjpe_mm", "wa_mpjpe100_mm", "w_mpjpe100_mm", "mpjpe_mm", "rte_pct", "rte_m", "roe_deg", "roe_yaw_deg",
    "accel_ms2", "jitter", "jitter_gt", "foot_sliding_mm", "foot_sliding_gt_mm", "cam_cut_rot_deg", "cam_ate_m",
    "coverage", "cut_f1",
)  # fmt: skip
"""What the Markdown table shows, in this order; results.json has everything."""
CHARTED = (
    ("wa_mpjpe100_mm", "WA-MPJPE, mm"), ("pa_mpjpe_mm", "PA-MPJPE, mm"), ("roe_deg", "ROE, degrees"),
    ("rte_m", "RTE, metres"), ("foot_sliding_mm", "foot sliding, mm a frame"), ("jitter", "jitter, 10 m/s³"),
)  # fmt: skip

_PAPER_KEYS = ("pa_mpjpe_mm", "wa_mpjpe100_mm", "rte_pct", "roe_deg", "jitter")
_PAPER = {
    "ms-Motion(20)": {
        "2 transitions": (33.96, 109.72, 2.12, 66.58, 33.49),
        "3 transitions": (40.12, 131.39, 3.94, 68.33, 31.82),
        "4 transitions": (42.64, 165.23, 4.32, 69.15, 32.22),
    },
    "ms-AIST": {
        "2 transitions": (36.82, 121.35, 2.56, 69.23, 33.27),
        "3 transitions": (38.52, 141.38, 3.64, 67.71, 35.07),
        "4 transitions": (39.63, 161.52, 4.55, 70.31, 39.49),
    },
}
"""The paper's own method in its main table and in "ms-Motion (20)". Its foot sliding is of other vertices, in
centimetres, and is left out; the unit of its RTE is not beyond doubt."""
_PAPER_CONCAT = dict(zip(_PAPER_KEYS, (106.48, 273.15, 10.86, 91.55, float("nan")), strict=True))
"""The paper's Baseline (Concat), on EMDB-1 with noise of its own."""


@dataclass(frozen=True)
class Chart:
    """Grouped bars: a group for each label, in it a bar for each series."""

    title: str
    groups: tuple[str, ...]
    series: tuple[tuple[str, tuple[Metric | None, ...]], ...]


def as_markdown(rows: Sequence[Row], *, paper: str) -> str:
    """A table for every split: a line a figure, a column a method, then the paper's; means with their intervals.

    `paper` names the paper's table to show.
    """
    parts = []
    for split in dict.fromkeys(row.split for row in rows):
        chosen = [row for row in rows if row.split == split]
        theirs = dict(zip(_PAPER_KEYS, _PAPER[paper].get(split, ()), strict=False))
        head = [f"{row.method} (failed {row.failed})" for row in chosen]
        head += [f"paper, {paper} (other data)", "paper, concat on EMDB-1 (other data)"] if theirs else []
        lines = [f"## {split}, n = {chosen[0].n}", "", "| | " + " | ".join(head) + " |", "|---|" + "---:|" * len(head)]
        for key in MAIN:
            if not any(key in row.metrics for row in chosen):
                continue
            cells = [_cell(row.metrics.get(key)) for row in chosen]
            cells += [_number(theirs.get(key)), _number(_PAPER_CONCAT.get(key))] if theirs else []
            lines.append(f"| `{key}` | " + " | ".join(cells) + " |")
        parts.append("\n".join(lines) + "\n")
    return "\n".join(parts)


def charts_of(rows: Sequence[Row]) -> tuple[Chart, ...]:
    """The main figures per split, and the camera's error per angle of the cut."""
    splits = tuple(dict.fromkeys(row.split for row in rows))
    methods = tuple(dict.fromkeys(row.method for row in rows))
    at = {(row.method, row.split): row.metrics for row in rows}
    charts = [
        Chart(title, splits, tuple((m, tuple(at.get((m, s), {}).get(key) for s in splits)) for m in methods))
        for key, title in CHARTED
    ]
    bounds = list(pairwise(ANGLES_DEG))
    whole = splits[-1]
    series = tuple((m, tuple(at.get((m, whole), {}).get(angle_key(*b)) for b in bounds)) for m in methods)
    title = "Error of the camera's turn at a cut, degrees, by the angle of the cut"
    return (Chart(title, tuple(f"{low}–{high}°" for low, high in bounds), series), *charts)


def _cell(metric: Metric | None) -> str:
    if metric is None:
        return ""
    low, high = metric.ci95
    return f"{metric.mean:.4g}" if low == high else f"{metric.mean:.4g} [{low:.3g}, {high:.3g}]"


def _number(value: float | None) -> str:
    return "" if value is None or value != value else f"{value:g}"
