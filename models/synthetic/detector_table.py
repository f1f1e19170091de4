"""The table of the detector's errors: one column a set of clips."""

from collections.abc import Mapping, Sequence

import numpy as np

from humanmm.models.synthetic.detector_errors import PersonErrors

_JOINTS = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")


def detector_table(sets: Mapping[str, Sequence[PersonErrors]]) -> str:
    """A Markdown table, figures down, sets across."""
    columns = [_column(errors) for errors in sets.values()]
    lines = [f"| | {' | '.join(sets)} |", f"|---|{'---:|' * len(sets)}"]
    for name in columns[0]:
        lines.append(f"| {name} | {' | '.join(column[name] for column in columns)} |")
    return "\n".join(lines) + "\n"


def _column(errors: Sequence[PersonErrors]) -> dict[str, str]:
    found = np.concatenate([e.found for e in errors])
    swapped = np.concatenate([e.swapped for e in errors])[found]
    flat = np.concatenate([np.linalg.norm(e.error, axis=-1) for e in errors])[found]
    solid = np.concatenate([e.landmark_m for e in errors])[found]
    rotated = np.concatenate([e.landmark_rotated_m for e in errors])[found]
    rotation = np.degrees(np.concatenate([e.rotation for e in errors])[found])
    column = {
        "clips, persons in shots, frames": f"{len({e.clip for e in errors})}, {len(errors)}, {len(found)}",
        "found, % of the frames in which the truth observes the person": f"{100 * found.mean():.1f}",
        "2D error, % of height: median": f"{100 * np.median(flat):.2f}",
        "2D error, % of height: 90 %": f"{100 * np.percentile(flat, 90):.2f}",
    }
    for k, joint in enumerate(_JOINTS):
        column[f"2D error, median: {joint}"] = f"{100 * np.median(flat[:, 2 * k : 2 * k + 2]):.2f}"
    return column | {
        "left-right swaps, % of found frames": f"{100 * swapped.mean():.1f}",
        "3D landmarks, size put right, mm: median": f"{1000 * np.median(solid):.0f}",
        "3D landmarks, best rotation, mm: median": f"{1000 * np.median(rotated):.0f}",
        "rotation of the 3D posture, °: median": f"{np.median(np.linalg.norm(rotation, axis=1)):.1f}",
        "… about x, y, z, °: mean": ", ".join(f"{v:.1f}" for v in rotation.mean(axis=0)),
    }
