"""Joints for spreadsheets: one row a frame and joint; the header names the unit. z up by default."""

import csv
from pathlib import Path

from humanmm.models.body.body24 import JOINT_NAMES
from humanmm.models.motion.excerpt import Excerpt
from humanmm.models.records.recording import RecordedPerson


def write_csv(excerpt: Excerpt, person: RecordedPerson, path: Path) -> None:
    """One person as csv, with a header line. `frame` is the video's, `observed` 0 where the motion was filled in."""
    recording = excerpt.recording
    digits = 5 if excerpt.unit == "m" else 3
    joints = excerpt.points(person.joints)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(("frame", "time_s", "shot", "observed", "joint", *(f"{axis}_{excerpt.unit}" for axis in "xyz")))
        for row, frame in enumerate(person.frame.tolist()):
            shown = int(excerpt.source_frame[frame])
            beginning = (shown, f"{recording.time_s[frame]:.6f}", int(recording.shot_index[frame]))
            observed = int(person.observed[row])
            for name, xyz in zip(JOINT_NAMES, joints[row].tolist(), strict=True):
                writer.writerow((*beginning, observed, name, *(f"{value:.{digits}f}" for value in xyz)))
