"""Human3.6M as its owners hand it out. Experimental: the layout is known from public descriptions and readers alone.

A folder with `metadata.xml` (of the release's own code: <w0> holds all cameras), `S1/MyPoseFeatures/D3_Positions/*.cdf`
(Poses_D3_Positions_S1.tgz; `Pose` (1,F,96): 32 joints, mm, world z up, 50 fps) and `S1/Videos/<action>.<camera>.mp4`.
"""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from humanmm.errors import InputError
from humanmm.models.benchmark.recordings import MultiviewSequence

FPS = 50.0
SUBJECTS = (1, 5, 6, 7, 8, 9, 11)
CAMERAS = ("54138969", "55011271", "58860488", "60457274")
"""In the order of <w0>."""
OBTAIN = (
    "get Human3.6M (vision.imar.ro/human3.6m, an account and its licence): Poses_D3_Positions_S*.tgz, Videos_S*.tgz, "
    "and metadata.xml from the release's code"
)
_JOINTS = {
    "Pelvis": 0, "R_Hip": 1, "R_Knee": 2, "R_Ankle": 3, "L_Hip": 6, "L_Knee": 7, "L_Ankle": 8, "Spine": 12,
    "Thorax": 13, "Nose": 14, "Head": 15, "L_Shoulder": 17, "L_Elbow": 18, "L_Wrist": 19, "R_Shoulder": 25,
    "R_Elbow": 26, "R_Wrist": 27,
}  # fmt: skip
_ALL_SUBJECTS = 11
_BROKEN = (("S11", "Directions"),)
"""Videos that are known to be damaged."""
_MM = 0.001


def sequence_names(root: Path) -> list[str]:
    """`S1/Directions 1` and so on: every action that has joints, subjects in order."""
    names = [
        f"S{subject}/{path.stem}"
        for subject in SUBJECTS
        for path in sorted((root / f"S{subject}" / "MyPoseFeatures" / "D3_Positions").glob("*.cdf"))
        if (f"S{subject}", path.stem) not in _BROKEN
    ]
    if not names:
        raise InputError(f"{root} holds no S*/MyPoseFeatures/D3_Positions/*.cdf; {OBTAIN}")
    return names


def read_multiview(root: Path, name: str) -> MultiviewSequence:
    """One action with its four videos, metres, z up."""
    subject, action = name.split("/", 1)
    videos = tuple(root / subject / "Videos" / f"{action}.{camera}.mp4" for camera in CAMERAS)
    for path in videos:
        if not path.is_file():
            raise InputError(f"{path} is missing; {OBTAIN}")
    K, R_world_cam, t_world_cam = _cameras(root / "metadata.xml", int(subject.removeprefix("S")))
    return MultiviewSequence(
        name=name.replace("/", "_").replace(" ", "_"),
        fps=FPS,
        joint_names=tuple(_JOINTS),
        people=(_positions(root / subject / "MyPoseFeatures" / "D3_Positions" / f"{action}.cdf"),),
        K=K,
        R_world_cam=R_world_cam,
        t_world_cam=t_world_cam,
        videos=videos,
    )


def _positions(path: Path) -> Float[np.ndarray, "F 17 3"]:
    try:
        import cdflib
    except ImportError:
        raise InputError(f"{path} is a CDF file; reading it needs the package cdflib: pip install cdflib") from None
    try:
        pose = np.asarray(cdflib.CDF(path).varget("Pose"), np.float64)
    except Exception as error:  # cdflib raises whatever comes
        raise InputError(f"{path} cannot be read as Human3.6M's positions: {error}") from error
    if pose.ndim not in (2, 3) or pose.shape[-1] != 96:
        raise InputError(f"{path}: Pose has shape {pose.shape}, expected (1, frames, 96)")
    return pose.reshape(-1, 32, 3)[:, list(_JOINTS.values())] * _MM


def _cameras(path: Path, subject: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """K (4,3,3), R_world_cam (4,3,3), t_world_cam (4,3) of one subject, from the 300 numbers of <w0>.

    Six for each of 4 cameras × 11 subjects (angles about x, y, z in this order of factors, centre in mm: x_cam =
    R (x − centre)), then nine for each camera (two focal lengths, principal point, five of the lens).
    """
    try:
        text = next(ElementTree.parse(path).getroot().iter("w0")).text or ""
        w0 = np.array([float(number) for number in text.strip().strip("[]").split()])
    except (OSError, ElementTree.ParseError, StopIteration, ValueError):
        raise InputError(f"{path} is missing or holds no cameras (<w0>); {OBTAIN}") from None
    per_camera = 6 * _ALL_SUBJECTS
    if len(w0) < per_camera * len(CAMERAS) + 9 * len(CAMERAS):
        raise InputError(f"{path}: <w0> holds {len(w0)} numbers, expected 300")
    outer = w0[: per_camera * len(CAMERAS)].reshape(len(CAMERAS), _ALL_SUBJECTS, 6)[:, subject - 1]
    inner = w0[per_camera * len(CAMERAS) :][: 9 * len(CAMERAS)].reshape(len(CAMERAS), 9)
    K = np.tile(np.eye(3), (len(CAMERAS), 1, 1))
    K[:, [0, 1], [0, 1]], K[:, :2, 2] = inner[:, :2], inner[:, 2:4]
    R_cam_world = Rotation.from_euler("XYZ", outer[:, :3]).as_matrix()
    return K, np.swapaxes(R_cam_world, -1, -2), outer[:, 3:] * _MM
