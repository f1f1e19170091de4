"""The flat object that `humanmm eval --json` prints, and its table for the terminal."""

from dataclasses import asdict, dataclass, fields

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
class Report(CameraFigures, PersonFigures, CutFigures):  # fields are in the order of the bases from the last on
    """Every figure of one prediction against its truth; None where it cannot be had, with the reason in `problems`.

    A figure of people is the mean over the truth's people.
    """

    problems: tuple[str, ...] = ()

    def to_json(self) -> dict[str, object]:
        """The object as it is printed, keys in their public order."""
        return asdict(self)


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
    for field in fields(report):
        if field.name != "problems":
            table.add_row(field.name, _shown(getattr(report, field.name)), MEANINGS[field.name])
    return table


def _shown(value: float | list[float | None] | None) -> str:
    if value is None:
        return "–"
    if isinstance(value, list):
        return ", ".join(_shown(item) for item in value) or "no cut"
    return f"{value:.3f}" if abs(value) < 10 else f"{value:.1f}"
