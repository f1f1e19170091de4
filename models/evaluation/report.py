"""The flat object that `humanmm eval --json` prints, and its table for the terminal."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from rich.table import Table
from rich.text import Text

from humanmm.logs import printable


@dataclass(frozen=True)
class CutFigures:
    """The figures of the cuts found."""

    cut_precision: float | None = None
    cut_recall: float | None = None
    cut_f1: float | None = None


@dataclass(frozen=True)
class PersonFigures:
    """The figures of one of the truth's people."""

    coverage: float | None = None
    pa_mpjpe_mm: float | None = None
    mpjpe_mm: float | None = None
    mpjpe_cam_mm: float | None = None
    pve_mm: float | None = None
    wa_mpjpe100_mm: float | None = None
    w_mpjpe100_mm: float | None = None
    rte_pct: float | None = None
    rte_m: float | None = None
    roe_deg: float | None = None
    roe_yaw_deg: float | None = None
    accel_ms2: float | None = None
    jitter: float | None = None
    jitter_gt: float | None = None
    foot_sliding_mm: float | None = None
    foot_sliding_gt_mm: float | None = None
    cut_jump_m: float | None = None
    cut_jump_deg: float | None = None


@dataclass(frozen=True)
class CameraFigures:
    """The figures of the cameras."""

    cam_ate_m: float | None = None
    cam_rpe_rot_deg: float | None = None
    cam_rpe_trans_m: float | None = None
    cam_cut_rot_deg: list[float | None] | None = None
    cam_shot_drift_deg: float | None = None
    focal_err_pct: float | None = None


@dataclass(frozen=True)
class PersonReport:
    """One of the truth's people, over the whole video."""

    person: int
    """Number in the truth."""
    predicted: int | None
    """Number in the prediction; None: nobody overlaps him."""
    frames: int
    """That both have."""
    coverage_observed: float | None
    """As `coverage`, without frames in which the prediction was filled in."""
    figures: PersonFigures

    def to_json(self) -> dict[str, object]:
        """Flat, as `eval --per person --json` prints it."""
        return {name: value for name, value in asdict(self).items() if name != "figures"} | asdict(self.figures)


@dataclass(frozen=True)
class ShotReport:
    """One of the truth's shots, as if the video were that shot; people are who they are in the whole video."""

    shot: int
    start: int
    end: int
    """Frames [start, end), without those of a dissolve."""
    figures: PersonFigures
    """Mean over the people whom the truth observes in the shot."""
    cameras: CameraFigures

    def to_json(self) -> dict[str, object]:
        """Flat, as `eval --per shot --json` prints it."""
        head = {"shot": self.shot, "start": self.start, "end": self.end}
        flat = head | asdict(self.figures) | asdict(self.cameras)
        return {name: value for name, value in flat.items() if name not in OF_CUTS}


OF_CUTS = ("cut_jump_m", "cut_jump_deg", "cam_cut_rot_deg")
"""Figures of cuts, which no shot has."""


@dataclass(frozen=True)
class Report(CameraFigures, PersonFigures, CutFigures):  # fields are in the order of the bases from the last on
    """Every figure of one prediction against its truth; None where it cannot be had, with the reason in `problems`.

    A figure of people is the mean over the truth's people.
    """

    problems: tuple[str, ...] = ()
    people: tuple[PersonReport, ...] = ()
    """Each of the truth's people."""
    shots: tuple[ShotReport, ...] = ()
    """Each of the truth's shots."""

    @property
    def coverage_observed(self) -> float | None:
        """As `coverage`, without frames in which the prediction was filled in."""
        return mean_of([one.coverage_observed for one in self.people])

    def to_json(self) -> dict[str, object]:
        """The flat object as `eval --json` prints it, keys in their public order: without people and shots."""
        flat = asdict(replace(self, people=(), shots=()))
        return {name: value for name, value in flat.items() if name not in ("people", "shots")}


def mean_of(values: Sequence[float | None]) -> float | None:
    """Mean of those that are known; None where none is."""
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


MEANINGS = {
    "cut_precision": "cuts found that are true",
    "cut_recall": "true cuts that were found",
    "cut_f1": "harmonic mean of the two",
    "coverage": "fraction of the truth's observed frames with a prediction",
    "pa_mpjpe_mm": "pose, after a similarity per frame",
    "mpjpe_mm": "pose, after one yaw for the whole video",
    "mpjpe_cam_mm": "pose, in camera axes",
    "pve_mm": "skin, in camera axes",
    "wa_mpjpe100_mm": "world, aligned over each 100 frames",
    "w_mpjpe100_mm": "world, aligned over the first 2 of each 100 frames",
    "rte_pct": "root trajectory, as a fraction of the path",
    "rte_m": "root trajectory",
    "roe_deg": "root orientation, aligned at the first frame",
    "roe_yaw_deg": "the same, headings only",
    "accel_ms2": "acceleration error",
    "jitter": "third difference, 10 m/s³",
    "jitter_gt": "the truth's own",
    "foot_sliding_mm": "standing feet, path per frame",
    "foot_sliding_gt_mm": "the truth's own",
    "cut_jump_m": "worst jump of the root at a cut beyond the truth's",
    "cut_jump_deg": "the same for its orientation",
    "cam_ate_m": "camera centres, after a similarity",
    "cam_rpe_rot_deg": "camera, rotation per frame inside shots",
    "cam_rpe_trans_m": "camera, path per frame inside shots",
    "cam_cut_rot_deg": "camera, relative rotation at each cut",
    "cam_shot_drift_deg": "camera, worst rotation inside a shot",
    "focal_err_pct": "focal length",
}


def report_table(report: Report, *, title: str) -> Table:
    """The figures as a table of name, value and meaning; problems stand in the caption."""
    problems = (
        Text(printable("\n".join(report.problems))) if report.problems else None
    )  # no markup, whatever they quote
    table = Table(title=Text(printable(title)), title_justify="left", caption=problems, caption_justify="left")
    table.add_column("figure")
    table.add_column("value", justify="right")
    table.add_column("what")
    for name in MEANINGS:
        table.add_row(name, _shown(getattr(report, name)), MEANINGS[name] + _remark(report, name))
    return table


def _remark(report: Report, name: str) -> str:
    observed = report.coverage_observed
    if name != "coverage" or observed is None:
        return ""
    return (
        " (observed in all of them)"
        if observed == report.coverage
        else f" ({_shown(observed)} observed, the others filled in)"
    )


def tables_per(parts: Sequence[PersonReport] | Sequence[ShotReport], *, title: str) -> list[Table]:
    """A line a figure, a column a person or shot, so many columns a table."""
    tables = []
    for begin in range(0, len(parts), COLUMNS):
        table = Table(title=Text(printable(title)), title_justify="left")
        chosen = parts[begin : begin + COLUMNS]
        table.add_column("figure")
        for part in chosen:
            table.add_column(_name(part), justify="right")
        columns = [part.to_json() for part in chosen]
        names = [name for name in columns[0] if name in (*MEANINGS, "coverage_observed")]
        for name in names:
            table.add_row(name, *(_shown(column[name]) for column in columns))  # type: ignore[arg-type]
        tables.append(table)
    return tables


COLUMNS = 6


def _name(part: PersonReport | ShotReport) -> str:
    if isinstance(part, ShotReport):
        return f"shot {part.shot}: {part.start}-{part.end - 1}"
    found = "not found" if part.predicted is None else f"found as {part.predicted}"
    return f"person {part.person}, {found}"


def _shown(value: float | list[float | None] | None) -> str:
    if value is None:
        return "–"
    if isinstance(value, list):
        return ", ".join(_shown(item) for item in value) or "no cut"
    return f"{value:.3f}" if abs(value) < 10 else f"{value:.1f}"
