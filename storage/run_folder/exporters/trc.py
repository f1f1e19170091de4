"""OpenSim's marker file (TRC), as Pose2Sim writes and reads it: joints as markers, y up, metres, tab-separated."""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from humanmm.models.body.body24 import JOINT_NAMES
from humanmm.models.records.recording import RecordedPerson, Recording


def write_trc(recording: Recording, person: RecordedPerson, path: Path) -> None:
    """One person as trc. Frame numbers are the video's, from 1; times are the video's."""
    rate = f"{recording.fps:.6g}"
    num_frames, num_markers = person.joints.shape[:2]
    start = int(person.frame[0]) + 1 if num_frames else 1
    header = (
        f"PathFileType\t4\t(X/Y/Z)\tperson_{person.person:02d}.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate}\t{rate}\t{num_frames}\t{num_markers}\tm\t{rate}\t{start}\t{num_frames}",
        "Frame#\tTime\t" + "\t\t\t".join(JOINT_NAMES) + "\t\t",
        "\t\t" + "\t".join(f"X{n}\tY{n}\tZ{n}" for n in range(1, num_markers + 1)),
        "",
    )
    positions = to_yup(person.joints).reshape(num_frames, -1)
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write("\n".join(header) + "\n")
        for row, frame in enumerate(person.frame.tolist()):
            values = "\t".join(f"{value:.6f}" for value in positions[row].tolist())
            file.write(f"{frame + 1}\t{recording.time_s[frame]:.6f}\t{values}\n")


def to_yup(points: Float[np.ndarray, "*batch 3"]) -> Float[np.ndarray, "*batch 3"]:
    """World points (z up) in OpenSim's axes (y up): x stays, z becomes y, y becomes −z."""
    x, y, z = np.moveaxis(np.asarray(points, np.float64), -1, 0)
    return np.stack([x, z, -y], axis=-1)
