"""The tables of joints, by way of joining shots, and of identities: how they are at cuts, and how far doubts hold."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from humanmm.models.benchmark.identity import PairFigures
from humanmm.models.benchmark.scores import CutError, MethodFigures, VideoFigures
from humanmm.models.benchmark.tables.groups import FAILED_DEG, ClipLabels
from humanmm.models.benchmark.tables.rows import ALL, Metric, Row, summarise
from humanmm.models.records.table import Table

SURE = 0.8
"""A rotation that is said to be right with a higher probability is claimed."""
SURE_LINK = 0.9
BINS = (0.0, 0.5, 0.7, 0.9, 0.97, 1.0)
"""Bounds of the groups of a link's probability."""
PUBLISHED = (
    ("Shot3R", 49.5, 50.0),
    ("Human3R", 59.1, 60.0),
    ("OnlineHMR", 74.4, 36.0),
    ("PromptHMR", 94.0, 44.0),
)
"""Rotation of the camera and jump of the root's orientation at real cuts between cameras of AIST++, degrees, as
published; of other sequences than ours."""
_HEAD = (
    "", "cuts", "rotation of the camera, °: median / mean / 90 %", f"> {FAILED_DEG:.0f}°", "of these claimed",
    "within one, two stated deviations; the 95 % stated", "orientation jump, °: median / mean",
    "root jump, m: median / mean", "anchor-MPJPE, mm: median / mean", "IDF1", "coverage", "failed",
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
    """Fractions of rotations that lie within one and two of the deviations that were stated, and within the angle that
    95 % were said to lie within; 68, 95 and 95 % would be right."""
    said = np.array(
        [
            (cut.error_deg, cut.stated_deg, cut.stated_95_deg)
            for cut in cuts
            if cut.error_deg is not None and cut.stated_deg is not None and cut.stated_95_deg is not None
        ]
    ).reshape(-1, 3)
    if not len(said):
        return ""
    error, one, most = said.T
    return " / ".join(f"{100 * np.mean(error <= limit):.0f} %" for limit in (one, 2 * one, most))


def _middle(values: Sequence[float], digits: int) -> str:
    return " / ".join(f"{value:.{digits}f}" for value in (np.median(values), np.mean(values))) if values else ""


def _mean(values: Sequence[float]) -> str:
    return f"{np.mean(values):.2f}" if values else ""


def identity_rows(figures: Sequence[PairFigures]) -> list[Row]:
    """A row for all pairs and one for each kind; `n` counts pairs."""
    return [Row("humanmm", name, len(chosen), 0, _metrics(chosen)) for name, chosen in _kinds(figures).items()]


def identity_tables(figures: Sequence[PairFigures]) -> list[Table]:
    """Links by kind of pair, and how often those that were made with some probability are right."""
    head = ("", "cut pairs", "true links", "links made", "precision", "recall", f"wrong with > {SURE_LINK:g}")
    lines = []
    for name, chosen in _kinds(figures).items():
        made = [link for one in chosen for link in one.made]
        right = sum(link.right for link in made)
        true = sum(one.true for one in chosen)
        lines.append(
            (
                name, str(len(chosen)), str(true), str(len(made)),
                f"{right / len(made):.3f}" if made else "", f"{right / true:.3f}" if true else "",
                str(sum(link.probability > SURE_LINK and not link.right for link in made)),
            )
        )  # fmt: skip
    made = [link for one in figures for link in one.made]
    bins = []
    for low, high in pairwise(BINS):
        inside = [link for link in made if low < link.probability <= high]
        columns = ([link.probability for link in inside], [link.right for link in inside])
        shares = [f"{np.mean(column):.3f}" if column else "" for column in columns]
        bins.append((f"{low:g} to {high:g}", str(len(inside)), *shares))
    calibration = Table(("probability", "links", "said, mean", "right"), tuple(bins), "How sure a link is")
    return [Table(head, tuple(lines), "Identity across cuts"), calibration]


def _kinds(figures: Sequence[PairFigures]) -> dict[str, list[PairFigures]]:
    return {
        ALL: list(figures),
        "of one recording": [one for one in figures if not one.unrelated],
        "of unrelated recordings": [one for one in figures if one.unrelated],
    }


def _metrics(figures: Sequence[PairFigures]) -> dict[str, Metric]:
    made = [link for one in figures for link in one.made]
    right, true = [float(link.right) for link in made], sum(one.true for one in figures)
    found = [1.0] * round(sum(right)) + [0.0] * (true - round(sum(right)))
    samples = {"link_precision": right, "link_recall": found}
    return {name: summarise(values) for name, values in samples.items() if values}
