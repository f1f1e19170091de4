"""The paper's own numbers, to stand beside ours. They are of other data: nothing here is a comparison of methods.

Its tables contradict themselves in places (docs/metrics.md): the unit of RTE is not beyond doubt, foot sliding is of
other vertices and called centimetres, "2-shot" means two transitions, and two cells of ms-H3.6M are left out because
columns were shifted there.
"""

from collections.abc import Mapping
from dataclasses import dataclass

_MAIN = ("pa_mpjpe_mm", "wa_mpjpe100_mm", "rte_pct", "roe_deg", "jitter", "foot_sliding_mm")
_ABLATION = (
    "pa_mpjpe_mm", "mpjpe_mm", "wa_mpjpe100_mm", "w_mpjpe100_mm", "pve_mm", "accel_ms2", "rte_pct", "roe_deg",
    "foot_sliding_mm",
)  # fmt: skip
_CUTS = ("cut_recall", "cut_precision", "cut_f1")
_CAMERA = (
    "cam_shot_ate_m", "cam_shot_rpe_trans_m", "cam_rpe_rot_deg", "wa_mpjpe100_mm", "w_mpjpe100_mm", "rte_pct", "jitter",
    "foot_sliding_mm",
)  # fmt: skip
_SPLITS = ("2 transitions", "3 transitions", "4 transitions")


@dataclass(frozen=True)
class PaperRow:
    """One row of one of the paper's tables."""

    label: str
    """What the paper calls it, and on which data."""
    values: Mapping[str, float]


def paper_row(table: str, method: str, split: str) -> PaperRow | None:
    """The paper's row that stands beside a method of ours on a split; None if it has none."""
    return _ROWS.get(table, {}).get((method, split)) or _ROWS.get(table, {}).get((method, ""))


def _row(label: str, keys: tuple[str, ...], values: tuple[float, ...]) -> PaperRow:
    return PaperRow(label, {key: value for key, value in zip(keys, values, strict=True) if value == value})


def _by_transitions(data: str, systems: Mapping[str, tuple[str, str]]) -> dict[tuple[str, str], PaperRow]:
    """Rows of a table that has six figures for each of 2, 3 and 4 transitions."""
    rows = {}
    for method, (label, text) in systems.items():
        values = [float(word) for word in text.split()]
        for k, split in enumerate(_SPLITS):
            rows[method, split] = _row(f"{label}, {data}", _MAIN, tuple(values[6 * k : 6 * k + 6]))
    return rows


_BASELINE = {
    ("concat", ""): _row(
        "Baseline (Concat), EMDB-1", _ABLATION, (106.48, 141.67, 273.15, 553.67, 122.15, 6.14, 10.86, 91.55, 14.91)
    )
}

_ROWS: Mapping[str, Mapping[tuple[str, str], PaperRow]] = {
    "ms-AIST": _BASELINE
    | _by_transitions(
        "ms-AIST",
        {
            "humanmm": (
                "HumanMM",
                "36.82 121.35 2.56 69.23 33.27 2.66  38.52 141.38 3.64 67.71 35.07 3.55  "
                "39.63 161.52 4.55 70.31 39.49 4.09",
            ),
            "SLAHMR": (
                "SLAHMR",
                "72.34 341.75 9.62 96.26 62.59 3.26  80.35 510.77 10.33 101.36 72.39 4.43  "
                "90.32 803.69 12.11 104.07 80.37 16.52",
            ),
            "WHAM": (
                "WHAM",
                "65.34 336.82 4.39 84.48 25.24 2.75  78.68 451.32 5.14 89.84 24.06 2.99  "
                "102.88 603.93 5.57 90.07 26.29 3.62",
            ),
            "GVHMR": (
                "GVHMR",
                "60.72 231.36 6.20 96.58 34.87 7.65  70.33 357.16 7.55 99.69 34.46 9.42  "
                "83.77 563.17 8.96 104.53 35.67 9.78",
            ),
        },
    ),
    "ms-H3.6M": _BASELINE
    | _by_transitions(
        "ms-H3.6M",
        {
            "humanmm": (
                "HumanMM",
                "40.52 132.13 3.65 53.39 19.05 4.17  45.35 145.36 5.33 58.26 17.35 4.62  "
                "50.59 147.62 6.20 61.22 19.77 5.12",
            ),
            "SLAHMR": (
                "SLAHMR",
                "80.67 352.61 16.67 111.97 37.80 7.93  97.15 562.10 16.91 118.46 52.23 9.96  "
                "107.90 748.58 17.85 116.72 65.15 11.58",
            ),
            "WHAM": (
                "WHAM",
                "71.32 313.58 11.41 82.42 18.40 5.09  79.51 423.98 12.36 84.85 18.87 5.03  "
                "90.50 512.66 12.91 90.34 18.40 5.69",
            ),
            "GVHMR": (
                "GVHMR",
                "64.63 254.30 6.94 81.93 18.45 8.80  80.79 296.74 nan nan 18.36 10.62  "
                "85.19 471.53 9.12 91.63 19.47 10.65",
            ),
        },
    ),
    "ms-Motion (20)": _BASELINE
    | _by_transitions(
        "ms-Motion (20)",
        {
            "humanmm": (
                "HumanMM",
                "33.96 109.72 2.12 66.58 33.49 1.69  40.12 131.39 3.94 68.33 31.82 3.01  "
                "42.64 165.23 4.32 69.15 32.22 3.52",
            ),
            "SLAHMR": (
                "SLAHMR",
                "75.54 326.15 9.35 94.63 63.74 3.15  81.22 523.98 11.59 105.44 74.12 4.55  "
                "93.45 811.31 14.85 109.56 80.69 14.12",
            ),
            "WHAM": (
                "WHAM",
                "65.14 339.85 4.65 81.12 25.29 2.82  83.10 501.29 7.82 89.88 25.85 3.05  "
                "100.20 801.63 5.97 94.36 27.29 3.98",
            ),
            "GVHMR": (
                "GVHMR",
                "66.18 234.96 5.82 92.13 35.77 4.72  72.63 359.99 6.42 97.45 35.63 5.85  "
                "90.52 588.40 9.02 96.75 31.66 9.52",
            ),
        },
    ),
    "ablation": _BASELINE
    | {
        (method, ""): _row(f"{label}, EMDB-1", _ABLATION, values)
        for method, label, values in (
            ("humanmm", "HumanMM", (50.49, 83.68, 194.77, 393.21, 75.77, 5.16, 3.54, 47.68, 3.28)),
            (
                "humanmm without orientation alignment",
                "w/o OAM",
                (73.56, 92.13, 243.65, 425.18, 79.64, 5.67, 6.61, 76.74, 4.45),
            ),
            ("humanmm without ms-HMR", "w/o ms-HMR", (78.24, 101.52, 246.42, 436.57, 85.77, 5.87, 3.89, 50.63, 3.54)),
            (
                "humanmm without trajectory predictor",
                "w/o trajectory predictor",
                (50.49, 83.68, 231.75, 432.17, 75.77, 5.75, 5.52, 47.68, 4.96),
            ),
            (
                "humanmm without trajectory refiner",
                "w/o trajectory refiner",
                (50.49, 83.68, 198.58, 397.65, 75.77, 5.23, 4.06, 47.68, 7.84),
            ),
        )
    },
    "shots": {
        (method, ""): _row(f"{label}, ms-Motion", _CUTS, values)
        for method, label, values in (
            ("humanmm without boxes and keypoints", "SD", (0.74, 0.72, 0.70)),
            ("humanmm without keypoints", "SD + Bbox", (0.88, 0.85, 0.86)),
            ("humanmm", "SD + Bbox + Pose", (0.96, 0.88, 0.92)),
        )
    },
    "camera": {
        (method, ""): _row(f"{label}, EMDB-2", _CAMERA, values)
        for method, label, values in (
            ("humanmm", "Masked LEAP-VO", (0.49, 0.83, 1.19, 112.70, 283.70, 3.10, 16.30, 3.50)),
            ("humanmm without masks", "LEAP-VO (w/o mask)", (0.50, 0.83, 1.21, 112.80, 284.10, 3.10, 16.30, 3.50)),
            ("humanmm with masked DPVO", "Masked DPVO", (0.50, 0.86, 1.21, 116.40, 303.90, 4.10, 17.40, 3.50)),
            ("humanmm with DPVO", "DPVO (w/o mask)", (0.48, 1.07, 1.26, 117.10, 305.40, 5.10, 17.90, 3.50)),
        )
    },
}
"""The camera table's motion is GVHMR's on these cameras; its WA and W are under the headings that fit GVHMR's own."""
