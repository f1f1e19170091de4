"""A file for the viewer of rerun.io (.rrd): people, cameras and the video on one time line, the times of the frames.

z up, metres. A person is /world/person_00 with `body` (triangles), `joints`, `bones` and `path`; a shot's camera is
/world/camera_0 with the overlay as its `picture`. People and cameras are cleared where they are not there.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from humanmm.errors import InputError
from humanmm.models.body.body24 import PARENTS
from humanmm.models.drawing.palette import person_color
from humanmm.models.drawing.surface import PosedSurface
from humanmm.models.records.recording import RecordedPerson, Recording
from humanmm.storage.store.files import replace_file

if TYPE_CHECKING:
    from rerun import RecordingStream

TIMELINE = "video"
_PICTURE_M = 0.6
_NS_PER_S = 1_000_000_000


def write_rrd(path: Path, recording: Recording, record: Mapping[str, Any], overlay: Path | None) -> None:
    """Write a run as .rrd; `overlay` is overlay.mp4. InputError if rerun is not installed."""
    try:
        import rerun as rr
    except ImportError:
        raise InputError("an .rrd needs the package rerun-sdk: pip install 'humanmm[rerun]'") from None

    def fill(fresh: Path) -> None:
        stream = rr.RecordingStream("humanmm", recording_id=record["video"]["sha256"])
        stream.save(str(fresh))
        stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for person in recording.people:
            _log_person(stream, recording, person)
        _log_cameras(stream, recording, overlay)
        for number, text in enumerate(record["warnings"]):
            stream.log(f"warnings/{number}", rr.TextLog(text, level="WARN"), static=True)
        stream.flush()
        stream.disconnect()

    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, fill)


def _log_person(stream: "RecordingStream", recording: Recording, person: RecordedPerson) -> None:
    import rerun as rr

    if len(person.frame) == 0:
        return
    name, color, surface = f"world/person_{person.person:02d}", person_color(person), PosedSurface(person)
    bones = [(PARENTS[joint], joint) for joint in range(1, len(PARENTS))]
    stream.log(f"{name}/body", rr.Mesh3D.from_fields(triangle_indices=surface.faces), static=True)
    for row, frame in enumerate(person.frame):
        _set_time(stream, recording, int(frame))
        vertices, normals = surface.in_camera(row, np.eye(3), np.zeros(3))
        shown = color if person.observed[row] else (150, 150, 155)
        stream.log(
            f"{name}/body",
            rr.Mesh3D.from_fields(vertex_positions=vertices, vertex_normals=normals, albedo_factor=shown),
        )
        joints = person.joints[row]
        stream.log(f"{name}/joints", rr.Points3D(joints, colors=[shown], radii=0.012))
        stream.log(
            f"{name}/bones", rr.LineStrips3D([joints[list(bone)] for bone in bones], colors=[shown], radii=0.006)
        )
    stream.log(f"{name}/path", rr.LineStrips3D([person.pelvis], colors=[color]), static=True)
    if int(person.frame[-1]) + 1 < recording.num_frames:
        _set_time(stream, recording, int(person.frame[-1]) + 1)
        for part in ("body", "joints", "bones"):
            stream.log(f"{name}/{part}", rr.Clear(recursive=False))


def _log_cameras(stream: "RecordingStream", recording: Recording, overlay: Path | None) -> None:
    import rerun as rr

    if overlay is not None:
        stream.log("video", rr.AssetVideo(path=overlay), static=True)
    for shot, (start, end) in enumerate(recording.shot_spans):
        name = f"world/camera_{shot}"
        for frame in range(start, end):
            _set_time(stream, recording, frame)
            pose = rr.Transform3D(translation=recording.t_world_cam[frame], mat3x3=recording.R_world_cam[frame])
            stream.log(name, pose)
            stream.log(
                f"{name}/picture",
                rr.Pinhole(
                    image_from_camera=recording.K[frame],
                    resolution=[recording.width, recording.height],
                    camera_xyz=rr.ViewCoordinates.RDF,
                    image_plane_distance=_PICTURE_M,
                ),
            )
            if overlay is not None:
                nanoseconds = round(float(recording.time_s[frame] - recording.time_s[0]) * _NS_PER_S)
                stream.log(f"{name}/picture", rr.VideoFrameReference(nanoseconds=nanoseconds, video_reference="video"))
        if end < recording.num_frames:
            _set_time(stream, recording, end)
            stream.log(name, rr.Clear(recursive=True))


def _set_time(stream: "RecordingStream", recording: Recording, frame: int) -> None:
    stream.set_time("frame", sequence=frame)
    stream.set_time(TIMELINE, duration=float(recording.time_s[frame] - recording.time_s[0]))
