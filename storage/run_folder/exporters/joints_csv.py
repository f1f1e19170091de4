"""World joints for spreadsheets: one row a frame and joint, metres, z up."""

import csv
from pathlib import Path

from humanmm.models.body.body24 import JOINT_NAMES
from humanmm.models.records.recording import RecordedPerson, Recording

COLUMNS = ("frame", "time_s", "shot", "observed", "joint", "x_m", "y_m", "z_m")


def write_csv(recording: Recording, person: RecordedPerson, path: Path) -> None:
    """One person as csv, with a header line."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for row, frame in enumerate(person.frame.tolist()):
            beginning = (frame, f"{recording.time_s[frame]:.6f}", int(recording.shot_index[frame]))
            observed = int(person.observed[row])
            for name, xyz in zip(JOINT_NAMES, person.joints[row].tolist(), strict=True):
                writer.writerow((*beginning, observed, name, *(f"{value:.5f}" for value in xyz)))
