"""How far bodies lie from people in the picture, as rows and tables: by clip, by joint, and in fast frames."""

from collections.abc import Mapping, Sequence

from humanmm.models.benchmark.tables.rows import ALL, Metric, Row, exact
from humanmm.models.evaluation.overlay import (
    FASTEST,
    JOINTS,
    OverlayError,
    PersonOverlay,
    fast_overlay_error,
    mean_offsets,
    overlay_error,
)
from humanmm.models.records.table import Table

FAST = f"fastest {FASTEST:.0%}".replace("%", " %")
TARGETS = (1.2, 4.0)
"""Median and 95th percentile to be reached, percent of the standing height."""

Clips = Mapping[str, Sequence[PersonOverlay]]


def overlay_rows(clips: Clips, refused: Sequence[str]) -> list[Row]:
    """A row for each clip (`n` its people), one for all and one for the fastest frames of each clip together."""
    everybody = [person for people in clips.values() for person in people]
    rows = [Row("humanmm", name, len(people), 0, _metrics(_errors(people))) for name, people in clips.items()]
    rows += [Row("humanmm", name, 1, 1, {}) for name in refused]
    rows.append(Row("humanmm", ALL, len(everybody), len(refused), _metrics(_errors(everybody))))
    rows.append(Row("humanmm", FAST, len(everybody), len(refused), _metrics(_fast_errors(clips))))
    return rows


def overlay_tables(clips: Clips) -> list[Table]:
    """Clips by joints, then the joints' offsets."""
    everybody = [person for people in clips.values() for person in people]
    lines = [_line(name, len(people), _errors(people)) for name, people in clips.items()]
    lines += [_line(ALL, len(everybody), _errors(everybody)), _line(FAST, len(everybody), _fast_errors(clips))]
    head = ("median, 95 %, % of the standing height", "people", "keypoints", "all joints", *JOINTS)
    goal = f"targets: median {TARGETS[0]:g}, 95 % {TARGETS[1]:g}"
    offsets = mean_offsets(everybody)
    beside = tuple((name, f"{right:+.2f}", f"{down:+.2f}") for name, (right, down) in offsets.items())
    return [
        Table(head, tuple(lines), f"The body beside what was seen ({goal})"),
        Table(("body less keypoint, median, %", "to the right", "downwards"), beside, "By landmark"),
    ]


def _errors(people: Sequence[PersonOverlay]) -> dict[str, OverlayError]:
    groups = {"": (), **JOINTS}
    found = {name: overlay_error(people, names) for name, names in groups.items()}
    return {name: error for name, error in found.items() if error is not None}


def _fast_errors(clips: Clips) -> dict[str, OverlayError]:
    """Of the frames that are fast within their clip."""
    groups = {"": (), **JOINTS}
    found = {name: fast_overlay_error(list(clips.values()), names) for name, names in groups.items()}
    return {name: error for name, error in found.items() if error is not None}


def _metrics(errors: Mapping[str, OverlayError]) -> dict[str, Metric]:
    metrics = {}
    for name, error in errors.items():
        for key, value in (("median_pct", error.median), ("p95_pct", error.p95)):
            metrics["_".join(filter(None, (name, key)))] = exact(value)
    return metrics


def _line(name: str, people: int, errors: Mapping[str, OverlayError]) -> tuple[str, ...]:
    cells = (f"{errors[key].median:.2f}, {errors[key].p95:.1f}" if key in errors else "" for key in ("", *JOINTS))
    return (name, str(people), str(errors[""].count) if "" in errors else "0", *cells)
