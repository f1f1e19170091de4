"""A project of Pose2Sim: synchronised videos of calibrated cameras (pose2sim.readthedocs.io).

A folder with `videos/`, one for each camera, and `calibration/` with a `*.qca.txt` of Qualisys or a `Calib*.toml`
(tables with `size`, `matrix`, `distortions`, `rotation`, `translation`; metres, world z up). Cameras and videos are
paired in the order of their names, as Pose2Sim does.
"""

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import cv2
import numpy as np
from jaxtyping import Float

from humanmm.errors import InputError
from humanmm.models.geometry.axes import centred_pixels
from humanmm.models.geometry.projection import inverse_pose
from humanmm.models.geometry.rotations import rotvec_to_rotmat

Array = np.ndarray
VIDEOS = frozenset({".mp4", ".mov", ".avi", ".mkv", ".mpg", ".mpeg", ".m4v", ".webm"})
_MM = 0.001
_SUBPIXELS = 64.0
"""Qualisys counts 64 to a pixel."""
_LENS = (
    "focalLengthU", "focalLengthV", "centerPointU", "centerPointV", "radialDistortion1", "radialDistortion2",
    "tangentalDistortion1", "tangentalDistortion2", "radialDistortion3",
)  # fmt: skip
"""Qualisys' names of fx, fy, cx, cy and OpenCV's k1, k2, p1, p2, k3."""
_LARGEST = 4_000_000
"""Bytes of a calibration."""


@dataclass(frozen=True)
class Rig:
    """C calibrated cameras and their videos."""

    name: str
    videos: tuple[Path, ...]
    K: Float[Array, "C 3 3"]
    """For pixel centres at .5."""
    distortion: Float[Array, "C 5"]
    """k1, k2, p1, p2, k3 (OpenCV)."""
    size: Float[Array, "C 2"]
    R_world_cam: Float[Array, "C 3 3"]
    t_world_cam: Float[Array, "C 3"]

    def ideal(self, camera: int, pixels: Float[Array, "*n 2"]) -> Float[Array, "*n 2"]:
        """Undistorted, at unit focal length."""
        flat = pixels.reshape(-1, 1, 2).astype(np.float64)
        return np.asarray(cv2.undistortPoints(flat, self.K[camera], self.distortion[camera])).reshape(pixels.shape)

    def bend_px(self) -> float:
        """How far the lenses move a picture's corner at most, pixels."""
        worst = 0.0
        for camera, size in enumerate(self.size):
            corners = np.array([[0, 0], [1, 0], [0, 1], [1, 1]]) * size
            straight = self.ideal(camera, corners) * self.K[camera, [0, 1], [0, 1]] + self.K[camera, :2, 2]
            worst = max(worst, float(np.linalg.norm(straight - corners, axis=-1).max()))
        return worst


def read_rig(root: Path) -> Rig:
    """The cameras and videos of a project; InputError if something is missing or they do not go together."""
    videos = tuple(sorted(path for path in (root / "videos").glob("*") if path.suffix.lower() in VIDEOS))
    if len(videos) < 2:
        raise InputError(f"{root / 'videos'} holds {len(videos)} videos; two or more cameras' are needed")
    folder = root / "calibration"
    files = [*sorted(folder.glob("*.qca.txt")), *sorted(folder.glob("Calib*.toml")), *sorted(folder.glob("*.toml"))]
    if not files:
        raise InputError(f"{folder} holds no *.qca.txt and no Calib*.toml; calibrate with Pose2Sim first")
    path = files[0]
    try:
        if path.stat().st_size > _LARGEST:
            raise ValueError(f"larger than {_LARGEST // 1_000_000} MB")
        arrays = _qualisys(path) if path.suffix == ".txt" else _toml(path)
    except (ValueError, KeyError, TypeError, AttributeError, OSError, ElementTree.ParseError) as error:
        raise InputError(f"{path} is no calibration of Pose2Sim: {error!r}") from None
    if len(arrays["K"]) != len(videos):
        raise InputError(f"{path} has {len(arrays['K'])} cameras, {root / 'videos'} {len(videos)} videos")
    if not all(np.isfinite(array).all() for array in arrays.values()) or (arrays["K"][:, [0, 1], [0, 1]] <= 0).any():
        raise InputError(f"{path}: the cameras have values that are no numbers, or focal lengths that are not positive")
    return Rig(root.resolve().name, videos, **arrays)


def _qualisys(path: Path) -> dict[str, Array]:
    """Cameras of a .qca.txt: rows r11…r33 are x_world = Rᵀ x_camera with y up and z backwards; x, y, z in mm."""
    found: dict[str, list[Any]] = {"K": [], "distortion": [], "size": [], "R_world_cam": [], "t_world_cam": []}
    elements = sorted(ElementTree.parse(path).getroot().iter("camera"), key=lambda one: str(one.get("serial")))
    for camera in elements:
        inner, pose, view = (camera.find(tag) for tag in ("intrinsic", "transform", "fov_video"))
        if inner is None or pose is None or view is None:
            raise ValueError("a camera lacks intrinsic, transform or fov_video")
        fx, fy, cx, cy, *distortion = (float(inner.attrib[name]) / _SUBPIXELS for name in _LENS)
        found["K"].append([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
        found["distortion"].append(distortion)
        found["size"].append(
            [float(view.attrib[b]) - float(view.attrib[a]) + 1 for a, b in (("left", "right"), ("top", "bottom"))]
        )
        rows = np.array([[float(pose.attrib[f"r{i}{j}"]) for j in (1, 2, 3)] for i in (1, 2, 3)])
        found["R_world_cam"].append(rows.T * [1, -1, -1])
        found["t_world_cam"].append([_MM * float(pose.attrib[axis]) for axis in "xyz"])
    arrays = {key: np.array(value, np.float64) for key, value in found.items()}
    return {**arrays, "K": centred_pixels(arrays["K"])}


def _toml(path: Path) -> dict[str, Array]:
    """Cameras of a .toml: rotation as a vector or a matrix, x_camera = R x_world + t."""
    tree = tomllib.loads(path.read_text(encoding="utf-8"))
    cameras = [one for one in tree.values() if isinstance(one, dict) and "matrix" in one]
    if not cameras:
        raise ValueError("no table of it has a matrix")
    turns = [np.array(one["rotation"], np.float64) for one in cameras]
    R_cam_world = np.array([turn if turn.shape == (3, 3) else rotvec_to_rotmat(turn.reshape(3)) for turn in turns])
    t_cam_world = np.array([one["translation"] for one in cameras], np.float64).reshape(-1, 3)
    R_world_cam, t_world_cam = inverse_pose(R_cam_world, t_cam_world)
    distortion = np.zeros((len(cameras), 5))
    for row, one in zip(distortion, cameras, strict=True):
        given = one.get("distortions", [])[:5]
        row[: len(given)] = given
    return {
        "K": centred_pixels(np.array([one["matrix"] for one in cameras], np.float64).reshape(-1, 3, 3)),
        "distortion": distortion,
        "size": np.array([one["size"] for one in cameras], np.float64).reshape(-1, 2),
        "R_world_cam": R_world_cam,
        "t_world_cam": t_world_cam,
    }
