"""How a motion table is shown: a part for every split, the paper's own numbers beside ours, charts for the page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

from humanmm.models.benchmark.tables.paper import paper_row
from humanmm.models.benchmark.tables.rows import ANGLES_DEG, Metric, Row, angle_key

MAIN: tuple[str, ...] = (
    "pa_mpjpe_mm", "wa_mpjpe100_mm", "w_mpjpe100_mm", "mpjpe_mm", "rte_pct", "rte_m", "roe_deg", "roe_yaw_deg",
    "accel_ms2", "jitter", "jitter_gt", "foot_sliding_mm", "foot_sliding_gt_mm", "cam_cut_rot_deg", "cam_ate_m",
    "pve_mm", "coverage", "cut_f1",
)  # fmt: skip
"""What the Markdown table shows, in this order; results.json has everything."""
OF_ABLATION: tuple[str, ...] = (
    "pa_mpjpe_mm", "mpjpe_mm", "wa_mpjpe100_mm", "w_mpjpe100_mm", "pve_mm", "accel_ms2", "rte_pct", "rte_m", "roe_deg",
    "foot_sliding_mm", "jitter", "cut_jump_m", "cut_jump_deg", "cam_cut_rot_deg",
)  # fmt: skip
"""What the table of modules shows: the paper's figures, then the jump at the cuts."""
OF_CAMERAS: tuple[str, ...] = (
    "cam_shot_ate_m", "cam_shot_rpe_trans_m", "cam_rpe_rot_deg", "cam_ate_m", "cam_rpe_trans_m", "cam_shot_drift_deg",
    "cam_cut_rot_deg", "focal_err_pct", "wa_mpjpe100_mm", "w_mpjpe100_mm", "rte_pct", "jitter", "foot_sliding_mm",
)  # fmt: skip
"""What the table of cameras shows: ATE and RPE inside shots, then of the whole video, then the motion that comes of
them."""
CHARTED = (
    ("wa_mpjpe100_mm", "WA-MPJPE, mm"), ("pa_mpjpe_mm", "PA-MPJPE, mm"), ("roe_deg", "ROE, degrees"),
    ("rte_m", "RTE, metres"), ("foot_sliding_mm", "foot sliding, mm a frame"), ("jitter", "jitter, 10 m/s³"),
)  # fmt: skip
OF_CUTS = (("cut_f1", "F1"), ("cut_precision", "precision"), ("cut_recall", "recall"))


@dataclass(frozen=True)
class Chart:
    """Grouped bars: a group for each label, in it a bar for each series."""

    title: str
    groups: tuple[str, ...]
    series: tuple[tuple[str, tuple[Metric | None, ...]], ...]


def as_markdown(
    rows: Sequence[Row], *, paper: str, figures: Sequence[str] = MAIN, lines: Literal["figures", "methods"] = "figures"
) -> str:
    """A table for every split: means with their intervals, the paper's numbers beside the methods that have some.

    `paper` names the paper's table; `lines` says whether a line is a figure or a method.
    """
    parts = []
    for split in dict.fromkeys(row.split for row in rows):
        chosen = [row for row in rows if row.split == split]
        shown = [key for key in figures if any(key in row.metrics for row in chosen)]
        columns: list[tuple[str, list[str]]] = []
        for row in chosen:
            columns.append((f"{row.method} (failed {row.failed})", [_cell(row.metrics.get(key)) for key in shown]))
            theirs = paper_row(paper, row.method, split)
            if theirs is not None:
                columns.append(
                    (f"paper: {theirs.label} (other data)", [_number(theirs.values.get(key)) for key in shown])
                )
        parts.append(f"## {split}, n = {chosen[0].n}\n\n{_grid([f'`{key}`' for key in shown], columns, lines)}")
    return "\n".join(parts)


def _grid(
    figures: Sequence[str], columns: Sequence[tuple[str, list[str]]], lines: Literal["figures", "methods"]
) -> str:
    if lines == "methods":
        head, body = list(figures), [[name, *cells] for name, cells in columns]
    else:
        head = [name for name, _ in columns]
        body = [[figure, *(cells[k] for _, cells in columns)] for k, figure in enumerate(figures)]
    text = ["| | " + " | ".join(head) + " |", "|---|" + "---:|" * len(head)]
    return "\n".join([*text, *("| " + " | ".join(line) + " |" for line in body)]) + "\n"


def bars_of(rows: Sequence[Row], charted: Sequence[tuple[str, str]]) -> tuple[Chart, ...]:
    """A chart for each figure and its title: a group for every split, a bar for every method."""
    splits, methods, at = _sides_of(rows)
    return tuple(
        Chart(title, splits, tuple((m, tuple(at.get((m, s), {}).get(key) for s in splits)) for m in methods))
        for key, title in charted
    )


def charts_of(rows: Sequence[Row]) -> tuple[Chart, ...]:
    """The camera's error per angle of the cut, then the main figures per split."""
    splits, methods, at = _sides_of(rows)
    bounds = list(pairwise(ANGLES_DEG))
    series = tuple((m, tuple(at.get((m, splits[-1]), {}).get(angle_key(*b)) for b in bounds)) for m in methods)
    title = "Error of the camera's turn at a cut, degrees, by the angle of the cut"
    return (Chart(title, tuple(f"{low}–{high}°" for low, high in bounds), series), *bars_of(rows, CHARTED))


def _sides_of(
    rows: Sequence[Row],
) -> tuple[tuple[str, ...], tuple[str, ...], dict[tuple[str, str], Mapping[str, Metric]]]:
    """Splits, methods, and the figures by method and split."""
    splits = tuple(dict.fromkeys(row.split for row in rows))
    methods = tuple(dict.fromkeys(row.method for row in rows))
    return splits, methods, {(row.method, row.split): row.metrics for row in rows}


def _cell(metric: Metric | None) -> str:
    if metric is None:
        return ""
    low, high = metric.ci95
    return f"{metric.mean:.4g}" if low == high else f"{metric.mean:.4g} [{low:.3g}, {high:.3g}]"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:g}"
