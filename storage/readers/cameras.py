"""Cameras that another program found: a TUM trajectory, or a COLMAP model as text.

| file | what is read | frame |
|---|---|---|
| TUM trajectory | `time tx ty tz qx qy qz qw` a line, camera to world | nearest time (*) |
| COLMAP's cameras.txt and images.txt | focal length, world to camera | last number of the image's name |

(*) in seconds of the video; whole numbers that go beyond its end are frames. Lenses are taken for pinholes with the
principal point in the middle; what that leaves out is said in a warning.
"""

import re

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial.transform import Rotation

from humanmm.config import GivenFile
from humanmm.errors import InputError
from humanmm.models.geometry.projection import inverse_pose
from humanmm.models.records.camera import GivenCameras
from humanmm.models.records.video import VideoFacts

Array = np.ndarray

FOCALS = {
    "SIMPLE_PINHOLE": 1, "PINHOLE": 2, "SIMPLE_RADIAL": 1, "RADIAL": 1, "OPENCV": 2, "FULL_OPENCV": 2,
}  # fmt: skip
"""Model of COLMAP → how many focal lengths come first; then the principal point, then distortion."""
OFF_CENTRE = 0.02
"""Fraction of the width by which a principal point may lie beside the middle without a warning."""
OTHER_SHAPE = 0.01
MAX_EXTRA_FRAMES = 2
UNIT_NORM = 0.02


def read_cameras(given: GivenFile, facts: VideoFacts) -> GivenCameras:
    """The cameras of those frames that the file names. InputError says in one sentence what is wrong."""
    try:
        texts = {name: _text(name, content) for name, content in given.read().items()}
        if {"cameras.txt", "images.txt"} <= texts.keys():
            return _colmap(texts["cameras.txt"], texts["images.txt"], facts)
        if len(texts) == 1:
            return _tum(next(iter(texts.values())), facts)
        raise InputError("it holds no cameras.txt and images.txt of COLMAP; a TUM trajectory is one file")
    except InputError as error:
        words = str(error)
        raise InputError(words if given.path in words else f"{given.path}: {words}") from None


def _text(name: str, content: bytes) -> str:
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError:
        raise InputError(f"{name} is no text") from None


def _tum(text: str, facts: VideoFacts) -> GivenCameras:
    lines = [line.replace(",", " ").split() for line in text.splitlines() if line.strip() and line.lstrip()[0] != "#"]
    rows = np.array([_floats(line, 8, "a line of a TUM trajectory") for line in lines]).reshape(-1, 8)
    if not len(rows):
        raise InputError("it holds no camera")
    frame, near = _frames_at(rows[:, 0], facts.time_s)
    frame, first = np.unique(frame[near], return_index=True)
    rows = rows[near][first]
    R = _rotations(rows[:, [4, 5, 6, 7]])
    return GivenCameras(frame.astype(np.int32), R, rows[:, 1:4], np.full(len(frame), np.nan))


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


def _colmap(cameras: str, images: str, facts: VideoFacts) -> GivenCameras:
    focal_of: dict[str, float] = {}
    warnings: list[str] = []
    for line in cameras.splitlines():
        if line.strip() and not line.startswith("#"):
            name, focal_px, said = _lens(line.split(), facts)
            focal_of[name] = focal_px
            warnings += [sentence for sentence in said if sentence not in warnings]
    rows: dict[int, list[float]] = {}
    lines = iter(images.splitlines())
    for line in lines:
        if not line.strip() or line.startswith("#"):
            continue
        words = line.split(maxsplit=9)
        next(lines, None)  # its points
        if len(words) != 10 or words[8] not in focal_of:
            raise InputError(f"images.txt has the line {line[:80]!r}; expected an image of a camera in cameras.txt")
        rows[_number_in(words[9])] = [*_floats(words[1:8], 7, "an image in images.txt"), focal_of[words[8]]]
    if not rows:
        raise InputError("images.txt holds no image")
    frame = np.array(sorted(rows))
    frame = _from_zero(frame, facts.num_frames)
    values = np.array([rows[number] for number in sorted(rows)])[frame < facts.num_frames]
    R_cam_given = _rotations(values[:, [1, 2, 3, 0]])
    R, t = inverse_pose(R_cam_given, values[:, 4:7])
    kept = frame[frame < facts.num_frames].astype(np.int32)
    return GivenCameras(kept, R, t, values[:, 7], tuple(warnings))


def _lens(words: list[str], facts: VideoFacts) -> tuple[str, float, list[str]]:
    """Its number, focal length in pixels of the video, and what a pinhole leaves out."""
    if len(words) < 5 or words[1] not in FOCALS:
        shown = " ".join(words)[:60]
        raise InputError(f"cameras.txt has the line {shown!r}; expected one of {', '.join(FOCALS)}")
    width, height, *parameters = _floats(words[2:], len(words) - 2, "a camera in cameras.txt")
    count = FOCALS[words[1]]
    if len(parameters) < count + 2 or min(width, height, *parameters[:count]) <= 0:
        raise InputError(f"camera {words[0]} of cameras.txt lacks parameters, or some are not positive")
    if abs(width / height * facts.height / facts.width - 1) > OTHER_SHAPE:
        raise InputError(
            f"camera {words[0]} of cameras.txt has pictures of {width:.0f}×{height:.0f}, the video of "
            f"{facts.width}×{facts.height}: is it of another video?"
        )
    said = []
    centre = np.array(parameters[count : count + 2]) - np.array([width, height]) / 2
    if np.abs(centre).max() > OFF_CENTRE * width:
        said.append("the given principal point is not in the middle of the picture; it is taken to be there")
    if np.abs(parameters[count + 2 :]).max(initial=0) > 0:
        said.append("the given lens distorts; it is taken for one that does not")
    return words[0], float(np.mean(parameters[:count])) * facts.width / width, said


def _from_zero(frame: Int[Array, " n"], num_frames: int) -> Int[Array, " n"]:
    if frame[0] == 1 and frame[-1] == num_frames:
        return frame - 1
    if frame[-1] >= num_frames + MAX_EXTRA_FRAMES:
        raise InputError(
            f"its images are of frames {frame[0]} to {frame[-1]}, the video has {num_frames} (0 to {num_frames - 1}): "
            "images are named by their frame"
        )
    return frame


def _number_in(name: str) -> int:
    found = re.findall(r"\d+", name.rsplit("/", 1)[-1].rsplit(".", 1)[0])
    if not found:
        raise InputError(f"no number in the name {name!r} says which frame it is")
    return int(found[-1])


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
