"""3DPW as its owners hand it out. Experimental: its layout is known from its readme, its world, y up, from readers.

A folder with `sequenceFiles/<split>/<sequence>.pkl` (cam_poses (F,4,4) world to camera, cam_intrinsics (3,3),
jointPositions: (F,72) for each actor, campose_valid: (F,) for each actor) and
`imageFiles/<sequence>/image_00000.jpg` …, 30 fps.
"""

from pathlib import Path
from typing import Any

import numpy as np

from humanmm.errors import InputError
from humanmm.models.benchmark.recordings import ImageRecording
from humanmm.models.evaluation.skeleton import SMPL_NAMES
from humanmm.models.geometry.axes import R_ZUP_YUP, centred_pixels, zup_camera_pose
from humanmm.storage.readers.restricted_pickle import read_pickle

FPS = 30.0
OBTAIN = "get 3DPW (virtualhumans.mpi-inf.mpg.de/3DPW, its licence): sequenceFiles.zip and imageFiles.zip"


def sequence_files(root: Path) -> list[Path]:
    """All sequence files of all splits, by name."""
    paths = sorted((root / "sequenceFiles").glob("*/*.pkl"))
    if not paths:
        raise InputError(f"{root / 'sequenceFiles'} holds no <split>/<sequence>.pkl; {OBTAIN}")
    return paths


def read_recording(root: Path, path: Path) -> ImageRecording:
    """One sequence with all its actors."""
    tree: Any = read_pickle(path)
    wanted = ("cam_poses", "cam_intrinsics", "jointPositions")
    missing = [key for key in wanted if not isinstance(tree, dict) or key not in tree]
    if missing:
        raise InputError(f"{path} lacks {', '.join(missing)}")
    poses = np.asarray(tree["cam_poses"], np.float64)
    joints = [np.asarray(one, np.float64) for one in tree["jointPositions"]]
    if poses.ndim != 3 or poses.shape[1:] != (4, 4) or any(one.shape != (len(poses), 72) for one in joints):
        raise InputError(
            f"{path}: cam_poses has shape {poses.shape}, jointPositions {[one.shape for one in joints]}; expected "
            "(frames, 4, 4) and (frames, 72) for each actor"
        )
    folder = root / "imageFiles" / path.stem
    pictures = tuple(folder / f"image_{frame:05d}.jpg" for frame in range(len(poses)))
    for picture in pictures:
        if not picture.is_file():
            raise InputError(f"{picture} is missing; {OBTAIN}")
    valid = tree.get("campose_valid") or [np.ones(len(poses), bool)] * len(joints)
    R_world_cam, t_world_cam = zup_camera_pose(poses[:, :3, :3], poses[:, :3, 3])
    return ImageRecording(
        name=path.stem,
        fps=FPS,
        pictures=pictures,
        joint_names=SMPL_NAMES,
        people=tuple(one.reshape(-1, 24, 3) @ R_ZUP_YUP.T for one in joints),
        observed=tuple(np.asarray(one).astype(bool) for one in valid),
        K=centred_pixels(np.asarray(tree["cam_intrinsics"], np.float64).reshape(3, 3)),
        R_world_cam=R_world_cam,
        t_world_cam=t_world_cam,
    )
