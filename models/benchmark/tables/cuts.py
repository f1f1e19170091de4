"""The table of joints: what every way of joining shots comes to at the cuts, and how far its own doubts hold."""

from collections.abc import Mapping, Sequence

import numpy as np

from humanmm.models.benchmark.scores import CutError, MethodFigures, VideoFigures
from humanmm.models.benchmark.tables.groups import FAILED_DEG, ClipLabels
from humanmm.models.records.table import Table

SURE = 0.8
"""A rotation that is said to be right with a higher probability is claimed."""
PUBLISHED = (
    ("Shot3R", 49.5, 36.0),
    ("Human3R", 59.1, 50.0),
    ("OnlineHMR", 74.4, 60.0),
    ("PromptHMR", 94.0, 44.0),
)
"""Rotation of the camera and jump of the root's orientation at real cuts between cameras of AIST++, degrees, as
published; of other sequences than ours."""
_HEAD = (
    "", "cuts", "rotation of the camera, °: median / mean / 90 %", f"> {FAILED_DEG:.0f}°", "of these claimed",
    "within one, two stated deviations", "orientation jump, °: median / mean", "root jump, m: median / mean",
    "anchor-MPJPE, mm: median / mean", "IDF1", "coverage", "failed",
)  # fmt: skip


def cut_tables(videos: Sequence[VideoFigures], labels: Mapping[str, ClipLabels]) -> list[Table]:
    """A table for every split of the clips' labels; a line a method. Cuts without a rotation count as wrong."""
    splits = dict.fromkeys(labels.get(video.video, ClipLabels()).split for video in videos)
    tables = []
    for split in splits:
        chosen = [video for video in videos if labels.get(video.video, ClipLabels()).split == split]
        methods = dict.fromkeys(one.method for video in chosen for one in video.methods)
        lines = [
            _line(method, [one for video in chosen for one in video.methods if one.method == method])
            for method in methods
        ]
        title = f"cuts inside a place, {f'{split}, ' if split else ''}n = {len(chosen)}"
        tables.append(Table(_HEAD, tuple(lines), title))
    published = tuple((name, f"{rotation:g}", f"{jump:g}") for name, rotation, jump in PUBLISHED)
    head = ("published, real cuts of AIST++, other sequences", "rotation of the camera, °", "orientation jump, °")
    return [*tables, Table(head, published, "other systems")]


def _line(method: str, done: Sequence[MethodFigures]) -> tuple[str, ...]:
    cuts = [cut for one in done for cut in one.cuts]
    known = [cut.error_deg for cut in cuts if cut.error_deg is not None]
    wrong = [cut for cut in cuts if cut.error_deg is None or cut.error_deg > FAILED_DEG]
    claimed = [cut for cut in wrong if (cut.probability or 0.0) > SURE]

    def figure(name: str) -> list[float]:
        return [one.value for each in done for one in each.figures if one.name == name]

    return (
        method,
        str(len(cuts)),
        " / ".join(f"{value:.1f}" for value in (np.median(known), np.mean(known), np.percentile(known, 90)))
        if known
        else "",
        f"{len(wrong)} ({100 * len(wrong) / len(cuts):.0f} %)" if cuts else "",
        str(len(claimed)),
        _calibration(cuts),
        _middle(figure("cut_jump_deg"), 1),
        _middle(figure("cut_jump_m"), 2),
        _middle(figure("anchor_mpjpe_mm"), 0),
        _mean(figure("idf1")),
        _mean([*figure("coverage"), *(0.0 for one in done if one.failure)]),
        str(sum(bool(one.failure) for one in done)),
    )


def _calibration(cuts: Sequence[CutError]) -> str:
    """Fractions of rotations that lie within one and two of the deviations that were stated; 68 and 95 % would be
    right."""
    said = [
        cut.error_deg / max(cut.stated_deg, 1e-9)
        for cut in cuts
        if cut.error_deg is not None and cut.stated_deg is not None
    ]
    if not said:
        return ""
    return " / ".join(f"{100 * np.mean(np.array(said) <= times):.0f} %" for times in (1, 2))


def _middle(values: Sequence[float], digits: int) -> str:
    return " / ".join(f"{value:.{digits}f}" for value in (np.median(values), np.mean(values))) if values else ""


def _mean(values: Sequence[float]) -> str:
    return f"{np.mean(values):.2f}" if values else ""
