"""How figures are spread: median, mean, 90 % and failures, by what a clip shows and by what its cuts are."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from humanmm.models.benchmark.scores import CutError, MethodFigures, VideoFigures
from humanmm.models.benchmark.tables.rows import ANGLES_DEG
from humanmm.models.records.table import Code, Table

FAILED_DEG, FAILED_M = 30.0, 0.5
"""A cut has failed if the camera's rotation there, or the root after it, is off by more."""
LOST_S = (0.0, 0.1, 0.35, np.inf)
"""Bounds of the groups of time lost at a cut; none lost is a group of its own."""
FIGURES = (
    "pa_mpjpe_mm", "wa_mpjpe100_mm", "w_mpjpe100_mm", "mpjpe_mm", "rte_pct", "rte_m", "roe_deg", "cut_jump_m",
    "cut_jump_deg", "cam_cut_rot_deg", "cam_ate_m", "focal_err_pct", "foot_sliding_mm", "jitter", "coverage", "cut_f1",
)  # fmt: skip


@dataclass(frozen=True)
class CutLabels:
    """What a true cut is."""

    kind: str
    lost_s: float


@dataclass(frozen=True)
class ClipLabels:
    """What a clip shows; a clip in two places counts in both."""

    split: str = ""
    motion: str = ""
    people: str = ""
    places: tuple[str, ...] = ()
    cameras: tuple[str, ...] = ()
    cuts: Mapping[int, CutLabels] | None = None
    """By the first frame after the cut."""


def labels_of(features: Mapping[str, Any]) -> ClipLabels:
    """The labels from what a clip's truth says of it (`features`)."""
    parts = features["parts"]
    people = len(parts[0]["people"])
    passing = any(part["passers_by"] for part in parts)
    return ClipLabels(
        split=features["split"],
        motion=parts[0]["people"][0]["motion"],
        people=f"{people}{' and passers-by' if passing else ''}",
        places=tuple(dict.fromkeys(part["place"] for part in parts)),
        cameras=tuple(dict.fromkeys(shot["camera"].split(",")[0] for part in parts for shot in part["shots"])),
        cuts={cut["frame"]: CutLabels(cut["kind"], cut["lost_s"]) for cut in features["cuts"]},
    )


def spread_tables(videos: Sequence[VideoFigures], labels: Mapping[str, ClipLabels]) -> list[Table]:
    """Tables of the first method: the cuts by every group, then every figure by group; splits stand side by side."""
    done = [(labels.get(video.video, ClipLabels()), video.methods[0]) for video in videos]
    splits = list(dict.fromkeys(label.split for label, _ in done))
    tables = [_cuts_table(done, splits)]
    ways: list[tuple[str, Callable[[ClipLabels], tuple[str, ...]]]] = [
        ("all clips", lambda label: ("all",)),
        ("by motion", lambda label: (label.motion,)),
        ("by people", lambda label: (label.people,)),
        ("by place", lambda label: label.places),
    ]
    for title, groups_of in ways:
        names = sorted({name for label, _ in done for name in groups_of(label) if name})
        columns = [
            (
                f"{name}, {split}" if split else name,
                [one for label, one in done if label.split == split and name in groups_of(label)],
            )
            for name in names
            for split in splits
        ]
        if columns:
            tables.append(_figures_table(title, [column for column in columns if column[1]]))
    return tables


def _figures_table(title: str, columns: Sequence[tuple[str, Sequence[MethodFigures]]]) -> Table:
    """A line a figure: median / mean / 90 %."""
    values = [
        {key: [f.value for one in column for f in one.figures if f.name == key] for key in FIGURES}
        for _, column in columns
    ]
    shown = [key for key in FIGURES if any(column[key] for column in values)]
    head = ("median / mean / 90 %", *(f"{name}, n = {len(column)}" for name, column in columns))
    lines = tuple((Code(key), *(_spread(column[key]) for column in values)) for key in shown)
    failed = ("failed clips", *(str(sum(bool(one.failure) for one in column)) for _, column in columns))
    return Table(head, (*lines, failed), f"{columns[0][1][0].method}, {title}")


def _cuts_table(done: Sequence[tuple[ClipLabels, MethodFigures]], splits: Sequence[str]) -> Table:
    """A line a group of cuts: how many, the camera's rotation, the root after the cut, and how many failed."""
    head = ["group"]
    for split in splits:
        name = f"{split}: " if split else ""
        head += [
            f"{name}cuts", "rotation, °: median / mean / 90 %", f"> {FAILED_DEG:.0f}°",
            "root after the cut, m: median / mean / 90 %", f"> {FAILED_M} m or nobody",
        ]  # fmt: skip
    groups: dict[str, dict[str, list[CutError]]] = {}
    for label, one in done:
        for cut in one.cuts:
            for name in _groups_of(label, cut):
                groups.setdefault(name, {}).setdefault(label.split, []).append(cut)
    order = sorted(groups, key=lambda name: (_ORDER.index(name.split(":")[0]), _natural(name)))
    rows = [(name, *(cell for split in splits for cell in _cells(groups[name].get(split, [])))) for name in order]
    return Table(tuple(head), tuple(rows), f"{done[0][1].method}, cuts inside a place")


_ORDER = ("all", "angle", "kind", "lost", "motion", "people", "place", "camera")


def _groups_of(label: ClipLabels, cut: CutError) -> list[str]:
    low, high = next((a, b) for a, b in pairwise(ANGLES_DEG) if cut.angle_deg < b or b == ANGLES_DEG[-1])
    names = ["all", f"angle: {low}-{high}°"]
    about = (label.cuts or {}).get(cut.frame)
    if about is not None:
        lost = "nothing"
        if about.lost_s > 0:
            a, b = next((a, b) for a, b in pairwise(LOST_S) if about.lost_s <= b)
            lost = f"{a:g}-{b:g} s" if np.isfinite(b) else f"over {a:g} s"
        names += [f"kind: {about.kind}", f"lost: {lost}"]
    names += [f"motion: {label.motion}"] if label.motion else []
    names += [f"people: {label.people}"] if label.people else []
    return [*names, *(f"place: {place}" for place in label.places), *(f"camera: {camera}" for camera in label.cameras)]


def _cells(cuts: Sequence[CutError]) -> list[str]:
    if not cuts:
        return ["", "", "", "", ""]
    angles = [cut.error_deg for cut in cuts if cut.error_deg is not None]
    roots = [cut.root_m for cut in cuts if cut.root_m is not None]
    failed = len(cuts) - sum(angle <= FAILED_DEG for angle in angles)
    away = len(cuts) - sum(root <= FAILED_M for root in roots)
    return [str(len(cuts)), _spread(angles), _fraction(failed, len(cuts)), _spread(roots), _fraction(away, len(cuts))]


def _spread(values: Sequence[float]) -> str:
    if not values:
        return ""
    return " / ".join(f"{value:.3g}" for value in (np.median(values), np.mean(values), np.percentile(values, 90)))


def _fraction(count: int, of: int) -> str:
    return f"{100 * count / of:.0f} %"


def _natural(name: str) -> tuple[int, str]:
    digits = "".join(c for c in name.split(":")[-1].split("-")[0] if c.isdigit())
    return (int(digits) if digits else -1, name)
