"""AIST++ annotations as Google hands them out, and the AIST dance videos.

Annotations (CC BY 4.0), a folder with `cameras/mapping.txt` (sequence and setting a line), `cameras/<setting>.json`
(list of name, size, matrix, rotation, translation, distortions), `keypoints3d/<sequence>.pkl` ({keypoints3d,
keypoints3d_optim}: (F,17,3) COCO order, cm, y up), `keypoints2d/<sequence>.pkl` ({keypoints2d: (9,F,17,3), timestamps,
…}), `ignore_list.txt`. Videos (terms of the AIST Dance Video Database): `<sequence with c01 … c09 for cAll>.mp4`,
60 fps.
"""

import json
from pathlib import Path

import numpy as np

from humanmm.errors import InputError
from humanmm.models.benchmark.recordings import MultiviewSequence
from humanmm.models.geometry.axes import R_ZUP_YUP, centred_pixels, zup_camera_pose
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.records.landmarks import COCO_NAMES
from humanmm.storage.readers.restricted_pickle import read_pickle

FPS = 60.0
OBTAIN = (
    "get the annotations of AIST++ (google.github.io/aistplusplus_dataset, CC BY 4.0) and, for clips with pictures, "
    "the videos of the AIST Dance Video Database (aistdancedb.ongaaccel.jp, its own terms)"
)
_CM = 0.01


def sequence_names(root: Path) -> list[str]:
    """All sequences that have joints and are not on the ignore list, by name."""
    names = sorted(path.stem for path in _folder(root, "keypoints3d").glob("*.pkl"))
    ignored = set(_text(root / "ignore_list.txt").split())
    kept = [name for name in names if name not in ignored]
    if not kept:
        raise InputError(f"{root / 'keypoints3d'} holds no sequence that is not on the ignore list; {OBTAIN}")
    return kept


def read_arrays(root: Path, name: str) -> dict[str, np.ndarray]:
    """One sequence as `bench ms-aist` reads it: plain arrays, units and axes as in the annotations."""
    cameras = _cameras(root, name)
    of_2d = _pickle(root / "keypoints2d" / f"{name}.pkl", ("keypoints2d", "timestamps"))
    of_3d = _pickle(root / "keypoints3d" / f"{name}.pkl", ("keypoints3d", "keypoints3d_optim"))
    found = of_2d["keypoints2d"].shape
    if found != (len(cameras["cam_K"]), len(of_3d["keypoints3d"]), 17, 3):
        raise InputError(f"{root / 'keypoints2d' / name}.pkl: keypoints2d has shape {found}, which fits neither the "
                         f"{len(cameras['cam_K'])} cameras nor the {len(of_3d['keypoints3d'])} frames")  # fmt: skip
    return {**of_3d, **of_2d, **cameras, "fps": np.array(FPS)}


def read_multiview(root: Path, videos: Path, name: str) -> MultiviewSequence:
    """One sequence with its nine videos, metres, z up."""
    cameras = _cameras(root, name)
    joints = _pickle(root / "keypoints3d" / f"{name}.pkl", ("keypoints3d_optim",))["keypoints3d_optim"]
    paths = tuple(videos / f"{name.replace('cAll', str(view))}.mp4" for view in cameras["cam_name"])
    for path in paths:
        if not path.is_file():
            raise InputError(f"{path} is missing; {OBTAIN}")
    R_world_cam, t_world_cam = zup_camera_pose(rotvec_to_rotmat(cameras["cam_rotvec"]), cameras["cam_t"] * _CM)
    return MultiviewSequence(
        name=name,
        fps=FPS,
        joint_names=COCO_NAMES,
        people=(joints.astype(np.float64) * _CM @ R_ZUP_YUP.T,),
        K=centred_pixels(cameras["cam_K"]),
        R_world_cam=R_world_cam,
        t_world_cam=t_world_cam,
        videos=paths,
    )


def _cameras(root: Path, name: str) -> dict[str, np.ndarray]:
    mapping = dict(line.split()[:2] for line in _text(root / "cameras" / "mapping.txt").splitlines() if line.strip())
    if name not in mapping:
        raise InputError(f"{root / 'cameras' / 'mapping.txt'} names no camera setting for {name}; {OBTAIN}")
    path = root / "cameras" / f"{mapping[name]}.json"
    try:
        cameras = json.loads(_text(path))
        return {
            "cam_name": np.array([str(one["name"]) for one in cameras]),
            "cam_size": np.array([one["size"] for one in cameras], np.int64),
            "cam_K": np.array([one["matrix"] for one in cameras], np.float64).reshape(-1, 3, 3),
            "cam_rotvec": np.array([one["rotation"] for one in cameras], np.float64).reshape(-1, 3),
            "cam_t": np.array([one["translation"] for one in cameras], np.float64).reshape(-1, 3),
            "cam_dist": np.array([one["distortions"] for one in cameras], np.float64),
        }
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
        raise InputError(f"{path} is no list of AIST++ cameras: {error!r}") from None


def _pickle(path: Path, wanted: tuple[str, ...]) -> dict[str, np.ndarray]:
    if not path.is_file():
        raise InputError(f"{path} is missing; {OBTAIN}")
    tree = read_pickle(path)
    if not isinstance(tree, dict) or any(not isinstance(tree.get(key), np.ndarray) for key in wanted):
        raise InputError(f"{path} lacks arrays that are expected there: {', '.join(wanted)}")
    return {key: tree[key] for key in wanted}


def _folder(root: Path, name: str) -> Path:
    if not (root / name).is_dir():
        raise InputError(f"{root / name} is missing; {OBTAIN}")
    return root / name


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        raise InputError(f"{path} is missing or unreadable; {OBTAIN}") from None
