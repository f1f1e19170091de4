"""OpenSim's marker file (TRC), as Pose2Sim writes and reads it: joints as markers, tab-separated; y up, metres unless
set otherwise."""

from pathlib import Path

from humanmm.models.body.body24 import JOINT_NAMES
from humanmm.models.motion.excerpt import Excerpt
from humanmm.models.records.recording import RecordedPerson


def write_trc(excerpt: Excerpt, person: RecordedPerson, path: Path) -> None:
    """One person as trc. Frame numbers are the video's, from 1, or those of the new rate; times are the video's."""
    recording = excerpt.recording
    rate = f"{excerpt.fps:.6g}"
    num_frames, num_markers = person.joints.shape[:2]
    number = (person.frame if excerpt.resampled else excerpt.source_frame[person.frame]) + 1
    header = (
        f"PathFileType\t4\t(X/Y/Z)\tperson_{person.person:02d}.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate}\t{rate}\t{num_frames}\t{num_markers}\t{excerpt.unit}\t{rate}\t{number[0]}\t{num_frames}",
        "Frame#\tTime\t" + "\t\t\t".join(JOINT_NAMES) + "\t\t",
        "\t\t" + "\t".join(f"X{n}\tY{n}\tZ{n}" for n in range(1, num_markers + 1)),
        "",
    )
    positions = excerpt.points(person.joints).reshape(num_frames, -1)
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write("\n".join(header) + "\n")
        for row, frame in enumerate(person.frame.tolist()):
            values = "\t".join(f"{value:.6f}" for value in positions[row].tolist())
            file.write(f"{number[row]}\t{recording.time_s[frame]:.6f}\t{values}\n")
