"""How a motion table is shown: a part for every split, the paper's own numbers beside ours."""

from collections.abc import Sequence
from typing import Literal

from humanmm.models.benchmark.tables.paper import paper_row
from humanmm.models.benchmark.tables.rows import Metric, Row
from humanmm.models.records.table import Code, Table

MAIN: tuple[str, ...] = (
    "pa_mpjpe_mm", "wa_mpjpe100_mm", "w_mpjpe100_mm", "mpjpe_mm", "rte_pct", "rte_m", "roe_deg", "roe_yaw_deg",
    "accel_ms2", "jitter", "jitter_gt", "foot_sliding_mm", "foot_sliding_gt_mm", "contact_f1", "cam_cut_rot_deg",
    "cam_ate_m", "pve_mm", "coverage", "cut_f1",
)  # fmt: skip
"""What the table shows, in this order; results.json has everything."""
OF_ABLATION: tuple[str, ...] = (
    "pa_mpjpe_mm", "mpjpe_mm", "wa_mpjpe100_mm", "w_mpjpe100_mm", "pve_mm", "accel_ms2", "rte_pct", "rte_m", "roe_deg",
    "foot_sliding_mm", "contact_f1", "jitter", "cut_jump_m", "cut_jump_deg", "cam_cut_rot_deg",
)  # fmt: skip
"""What the table of modules shows: the paper's figures, then the jump at the cuts."""
OF_CAMERAS: tuple[str, ...] = (
    "cam_shot_ate_m", "cam_shot_rpe_trans_m", "cam_rpe_rot_deg", "cam_ate_m", "cam_rpe_trans_m", "cam_shot_drift_deg",
    "cam_cut_rot_deg", "focal_err_pct", "wa_mpjpe100_mm", "w_mpjpe100_mm", "rte_pct", "jitter", "foot_sliding_mm",
)  # fmt: skip
"""What the table of cameras shows: ATE and RPE inside shots, then of the whole video, then the motion that comes of
them."""
OF_JOINTS: tuple[str, ...] = (
    "anchor_mpjpe_mm", "wa_mpjpe100_mm", "w_mpjpe100_mm", "rte_pct", "roe_deg", "cut_jump_m", "cut_jump_deg",
    "cam_cut_rot_deg", "idf1", "cut_f1", "coverage",
)  # fmt: skip
"""What the table of cuts shows beside `tables.cuts`."""


def tables_of(
    rows: Sequence[Row], *, paper: str, figures: Sequence[str] = MAIN, lines: Literal["figures", "methods"] = "figures"
) -> list[Table]:
    """A table for every split: means with their intervals, the paper's numbers beside the methods that have some.

    `paper` names the paper's table; `lines` says whether a line is a figure or a method.
    """
    tables = []
    for split in dict.fromkeys(row.split for row in rows):
        chosen = [row for row in rows if row.split == split]
        shown = [key for key in figures if any(key in row.metrics for row in chosen)]
        columns = []
        for row in chosen:
            columns.append((f"{row.method} (failed {row.failed})", *(_cell(row.metrics.get(key)) for key in shown)))
            theirs = paper_row(paper, row.method, split)
            if theirs is not None:
                name = f"paper: {theirs.label} (other data)"
                columns.append((name, *(_number(theirs.values.get(key)) for key in shown)))
        grid = [("", *map(Code, shown)), *columns]
        head, *body = grid if lines == "methods" else zip(*grid, strict=True)
        tables.append(Table(head, tuple(body), f"{split}, n = {chosen[0].n}"))
    return tables


def note_on_ate(in_two_places: int, num_videos: int) -> list[Table]:
    """A word below the tables where the true cameras of some videos leave no error to the trajectory."""
    if not in_two_places:
        return []
    why = "their true cameras stand in two places, and a similarity takes any two to these"
    text = f"of {in_two_places} of {num_videos} videos it says nothing of where the cameras stand: {why}"
    return [Table(("", "note"), ((Code("cam_ate_m"), text),))]


def plain_table(rows: Sequence[Row]) -> Table:
    """A line a figure, a column a row of the benchmark; the interval where there is one."""
    keys = dict.fromkeys(key for row in rows for key in row.metrics)
    head = ("", *(f"{row.method}, {row.split} (n = {row.n}, failed {row.failed})" for row in rows))
    return Table(head, tuple((Code(key), *(_cell(row.metrics.get(key), digits=4) for row in rows)) for key in keys))


def _cell(metric: Metric | None, *, digits: int = 3) -> str:
    """The mean, and its interval with so many digits."""
    if metric is None:
        return ""
    low, high = metric.ci95
    interval = "" if low == high else f" [{low:.{digits}g}, {high:.{digits}g}]"
    return f"{metric.mean:.4g}{interval}"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:g}"
