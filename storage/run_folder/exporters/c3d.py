"""C3D, the biomechanists' binary marker file, through ezc3d (MIT, needs numpy alone): z up, millimetres unless set
otherwise.

Every frame of the excerpt is there. Where the person is not, points are not a number and their residual is −1, the
format's own word for "not seen"; motion that was filled in has the residual 0, which stands for computed points.
Cuts are events.
"""

import shutil
import tempfile
from pathlib import Path

import numpy as np

from humanmm.errors import InputError
from humanmm.models.body.body24 import JOINT_NAMES, NUM_JOINTS
from humanmm.models.motion.excerpt import Excerpt
from humanmm.models.records.recording import RecordedPerson

MAX_FRAMES = 65535
"""The header counts frames in 16 bits, and ezc3d reads no more."""
_AXES = {"y": ("+X", "+Y"), "z": ("+X", "+Z")}
_MEASURED = 1.0
"""A residual above zero says "measured"; how well we do not claim to know."""


def write_c3d(excerpt: Excerpt, person: RecordedPerson, path: Path) -> None:
    """One person as c3d. InputError if ezc3d is not installed."""
    try:
        import ezc3d
    except ImportError:
        raise InputError("c3d files need the package ezc3d: pip install 'humanmm[c3d]'") from None
    recording = excerpt.recording
    if recording.num_frames > MAX_FRAMES:
        raise InputError(
            f"c3d counts to {MAX_FRAMES} frames, these are {recording.num_frames}; take a part with --start and --end"
        )
    points = np.full((4, NUM_JOINTS, recording.num_frames), np.nan)
    points[:3, :, person.frame] = excerpt.points(person.joints).transpose(2, 1, 0)
    points[3] = 1.0
    residuals = np.full((1, NUM_JOINTS, recording.num_frames), -1.0)
    residuals[0, :, person.frame] = np.where(person.observed, _MEASURED, 0.0)[:, None]
    file = ezc3d.c3d()
    about = file["parameters"]["POINT"]
    about["RATE"]["value"], about["UNITS"]["value"] = [excerpt.fps], [excerpt.unit]
    about["LABELS"]["value"] = list(JOINT_NAMES)
    across, up = _AXES[excerpt.up]
    file.add_parameter("POINT", "X_SCREEN", [across])
    file.add_parameter("POINT", "Y_SCREEN", [up])
    file.add_parameter("SUBJECTS", "NAMES", [f"person_{person.person:02d}"])
    file.add_parameter("HUMANMM", "VIDEO_FRAME", [int(excerpt.source_frame[0])])
    for cut in recording.cut_frames:
        file.add_event([0.0, float(cut / excerpt.fps)], "General", "cut")
    file["data"]["points"] = points
    file["data"]["meta_points"]["residuals"] = residuals
    with tempfile.TemporaryDirectory() as folder:  # ezc3d takes no path that is not UTF-8
        written = Path(folder) / "person.c3d"
        file.write(str(written))
        shutil.copyfile(written, path)
