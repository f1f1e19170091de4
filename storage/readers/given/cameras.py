"""Cameras that another program found: TUM trajectories, or a COLMAP model as text or binary.

| file | what is read | frame |
|---|---|---|
| TUM trajectories: one, or a folder's .tum, else .txt | `time t quat_xyzw`, camera to world | nearest time (*) |
| COLMAP's cameras and images, .txt or .bin | focal length, world to camera | last number of the image's name |

(*) in seconds of the video; whole numbers that go beyond its end are frames. COLMAP's pictures are of square pixels, or
of those that are stored: their proportion tells. Lenses are taken for pinholes with the
principal point in the middle; what that leaves out is said in a warning.
"""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial.transform import Rotation

from humanmm.config import GIVEN_SUFFIXES, GivenFile
from humanmm.errors import InputError
from humanmm.models.geometry.projection import inverse_pose
from humanmm.models.records.camera import GivenCameras
from humanmm.models.records.video import VideoFacts
from humanmm.storage.readers.given.colmap import FILES, ColmapCamera, ColmapModel, colmap_model
from humanmm.storage.readers.given.frame_names import doubt_of_first, frame_number

Array = np.ndarray

OFF_CENTRE = 0.02
"""Fraction of the width by which a principal point may lie beside the middle without a warning."""
OTHER_SHAPE = 0.01
MAX_EXTRA_FRAMES = 2
UNIT_NORM = 0.02


def read_cameras(given: GivenFile, facts: VideoFacts) -> GivenCameras:
    """The cameras of those frames that the file names. InputError says in one sentence what is wrong."""
    try:
        contents = given.read()
        if any(all(name in contents for name in names) for names in FILES):
            return _colmap(colmap_model(contents), facts)
        return _tum([_text(name, contents[name]) for name in _trajectories(contents)], facts)
    except InputError as error:
        words = str(error)
        raise InputError(words if given.path in words else f"{given.path}: {words}") from None


def _trajectories(contents: Mapping[str, bytes]) -> list[str]:
    """Names of the files that are trajectories."""
    tum, txt = ([name for name in contents if name.endswith(suffix)] for suffix in (".tum", ".txt"))
    named = tum or txt or [name for name in contents if not name.endswith(GIVEN_SUFFIXES)]
    if not named:
        raise InputError(
            f"no TUM trajectory and no COLMAP model in {', '.join(sorted(contents)[:3])}; give a .tum or .txt file, "
            "a folder of them (`humanmm camera` and `humanmm export --format tum` write one), or a folder that holds "
            "COLMAP's cameras and images"
        )
    return named


def _text(name: str, content: bytes) -> str:
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError:
        raise InputError(f"{name} is no text") from None


def _tum(texts: list[str], facts: VideoFacts) -> GivenCameras:
    lines = [line.replace(",", " ").split() for text in texts for line in text.splitlines()]
    rows = [_floats(line, 8, "a line of a TUM trajectory") for line in lines if line and not line[0].startswith("#")]
    if not rows:
        raise InputError("it holds no camera")
    values = np.array(rows)
    frame, near = _frames_at(values[:, 0], facts.time_s)
    frame, first = np.unique(frame[near], return_index=True)
    values = values[near][first]
    R = _rotations(values[:, [4, 5, 6, 7]])
    return GivenCameras(frame.astype(np.int32), R, values[:, 1:4], np.full(len(frame), np.nan))


def _frames_at(moments: Float[Array, " n"], time_s: Float[Array, " F"]) -> tuple[Int[Array, " n"], Array]:
    """The frames at some moments, and whether each has one."""
    count = len(time_s)
    interval_s = float(np.median(np.diff(time_s))) if count > 1 else np.inf
    beyond = moments.max() > time_s[-1] + MAX_EXTRA_FRAMES * interval_s
    if (
        beyond
        and (moments == np.rint(moments)).all()
        and moments.min() >= 0
        and moments.max() < count + MAX_EXTRA_FRAMES
    ):
        return moments.astype(np.int64), moments < count
    if beyond:
        raise InputError(
            f"its times go to {moments.max():g} s, the video ends at {time_s[-1]:.3f} s; "
            "expected seconds of the video, or frame numbers from 0"
        )
    frame = _nearest(moments, time_s)
    near = np.abs(time_s[frame] - moments) <= 0.51 * interval_s
    if not near.any():
        raise InputError("none of its times is that of a frame of the video")
    return frame, near


def _nearest(moments: Float[Array, " n"], time_s: Float[Array, " F"]) -> Int[Array, " n"]:
    if len(time_s) == 1:
        return np.zeros(len(moments), np.int64)
    after = np.clip(np.searchsorted(time_s, moments), 1, len(time_s) - 1)
    return np.where(moments - time_s[after - 1] <= time_s[after] - moments, after - 1, after)


def _colmap(model: ColmapModel, facts: VideoFacts) -> GivenCameras:
    warnings: list[str] = []
    focal_of: dict[int, float] = {}
    for camera in model.cameras:
        focal_of[camera.number], said = _lens(camera, facts)
        warnings += [sentence for sentence in said if sentence not in warnings]
    rows: dict[int, list[float]] = {}
    for image in model.images:
        if image.camera not in focal_of:
            raise InputError(f"image {image.name!r} is of camera {image.camera}, which the model does not hold")
        rows[frame_number(image.name)] = [*image.quat_wxyz, *image.t_cam_world, focal_of[image.camera]]
    if not rows:
        raise InputError("the model holds no image")
    frame = _from_zero(np.array(sorted(rows)), facts.num_frames)
    warnings += doubt_of_first("cameras", int(frame[0]))
    values = np.array([rows[number] for number in sorted(rows)])[frame < facts.num_frames]
    R_cam_given = _rotations(values[:, [1, 2, 3, 0]])
    R, t = inverse_pose(R_cam_given, values[:, 4:7])
    kept = frame[frame < facts.num_frames].astype(np.int32)
    return GivenCameras(kept, R, t, values[:, 7], tuple(warnings))


def _lens(camera: ColmapCamera, facts: VideoFacts) -> tuple[float, list[str]]:
    """Its focal length in pixels of the video, and what a pinhole leaves out."""
    width, height, parameters, count = camera.width, camera.height, camera.parameters, camera.num_focals
    size = facts.sizes.like(width, height, within=OTHER_SHAPE)
    if size is None:
        raise InputError(
            f"camera {camera.number} of COLMAP's model has pictures of {width:.0f}×{height:.0f}, the video of "
            f"{facts.sizes.text}: is it of another video?"
        )
    said = []
    if size != facts.sizes.square and count == 1:
        said.append(
            "the given camera has one focal length for pixels that are not square: its path is bent; give COLMAP "
            f"pictures of {facts.width}×{facts.height}, or a PINHOLE camera"
        )
    centre = np.array(parameters[count : count + 2]) - np.array([width, height]) / 2
    if np.abs(centre).max() > OFF_CENTRE * width:
        said.append("the given principal point is not in the middle of the picture; it is taken to be there")
    if np.abs(parameters[count + 2 :]).max(initial=0) > 0:
        said.append("the given lens distorts; it is taken for one that does not")
    focal_px = np.array(parameters[:count]) * size[0] / width  # of x and y, or of both
    return float(np.mean(np.array(facts.sizes.square) / size * focal_px)), said


def _from_zero(frame: Int[Array, " n"], num_frames: int) -> Int[Array, " n"]:
    if frame[0] == 1 and frame[-1] == num_frames:
        return frame - 1
    if frame[-1] >= num_frames + MAX_EXTRA_FRAMES:
        raise InputError(
            f"its images are of frames {frame[0]} to {frame[-1]}, the video has {num_frames} (0 to {num_frames - 1}): "
            "images are named by their frame"
        )
    return frame


def _floats(words: list[str], count: int, what: str) -> list[float]:
    try:
        values = [float(word) for word in words]
    except ValueError:
        values = []
    if len(values) != count or not np.isfinite(values).all():
        raise InputError(f"{what} reads {' '.join(words)[:80]!r}; expected {count} numbers")
    return values


def _rotations(xyzw: Float[Array, "n 4"]) -> Float[Array, "n 3 3"]:
    norm = np.linalg.norm(xyzw, axis=1)
    if (np.abs(norm - 1) > UNIT_NORM).any():
        row = int(np.flatnonzero(np.abs(norm - 1) > UNIT_NORM)[0])
        raise InputError(f"camera {row} has a quaternion of length {norm[row]:.3g}; expected 1")
    return np.asarray(Rotation.from_quat(xyzw).as_matrix())
