"""EMDB as its owners hand it out. Experimental: its layout is as documented, its world, y up, from readers.

A folder with `P0` … `P9`, in each `<sequence>/<P>_<sequence>_data.pkl` (emdb1, emdb2, n_frames, gender,
good_frames_mask, camera: intrinsics (3,3), extrinsics (F,4,4) world to camera; smpl: poses_root (F,3), poses_body
(F,69), trans (F,3), betas (10,)) and `<sequence>/images/00000.jpg` …, 30 fps. It holds no joints: they come from the
user's own SMPL model.
"""

from pathlib import Path
from typing import Any

import numpy as np

from humanmm.errors import InputError
from humanmm.models.benchmark.recordings import ImageRecording
from humanmm.models.body.smpl_joints import SmplJoints
from humanmm.models.evaluation.skeleton import SMPL_NAMES
from humanmm.models.geometry.axes import R_ZUP_YUP, centred_pixels, zup_camera_pose
from humanmm.storage.readers.restricted_pickle import read_pickle

FPS = 30.0
OBTAIN = "get EMDB (eth-ait.github.io/emdb, an application form) and unzip P0 to P9 into one folder"


def sequence_files(root: Path, split: int) -> list[Path]:
    """The sequences of EMDB-1 or EMDB-2, by name."""
    paths = sorted(root.glob("P*/*/*_data.pkl"))
    if not paths:
        raise InputError(f"{root} holds no P*/<sequence>/*_data.pkl; {OBTAIN}")
    chosen = [path for path in paths if bool(_tree(path).get(f"emdb{split}"))]
    if not chosen:
        raise InputError(f"none of the {len(paths)} sequences in {root} belongs to EMDB-{split}; {OBTAIN}")
    return chosen


def read_recording(path: Path, body: SmplJoints) -> ImageRecording:
    """One sequence."""
    tree = _tree(path)
    try:
        camera, smpl = tree["camera"], tree["smpl"]
        poses = np.asarray(camera["extrinsics"], np.float64)
        parameters = [np.asarray(smpl[key], np.float64) for key in ("poses_root", "poses_body", "betas", "trans")]
        good = np.asarray(tree["good_frames_mask"]).astype(bool)
        K = np.asarray(camera["intrinsics"], np.float64).reshape(3, 3)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path} is not as EMDB documents it: {error!r}") from None
    count = len(poses)
    shapes = [(count, 3), (count, 69), (10,), (count, 3)]
    if poses.shape != (count, 4, 4) or [one.shape for one in parameters] != shapes or good.shape != (count,):
        raise InputError(f"{path}: parameters have shapes {[one.shape for one in parameters]}, expected {shapes}")
    pictures = tuple(path.parent / "images" / f"{frame:05d}.jpg" for frame in range(count))
    for picture in pictures:
        if not picture.is_file():
            raise InputError(f"{picture} is missing; {OBTAIN}")
    R_world_cam, t_world_cam = zup_camera_pose(poses[:, :3, :3], poses[:, :3, 3])
    return ImageRecording(
        name=path.stem.removesuffix("_data"),
        fps=FPS,
        pictures=pictures,
        joint_names=SMPL_NAMES,
        people=(body.posed(*parameters) @ R_ZUP_YUP.T,),
        observed=(good,),
        K=centred_pixels(K),
        R_world_cam=R_world_cam,
        t_world_cam=t_world_cam,
    )


def _tree(path: Path) -> dict[str, Any]:
    tree = read_pickle(path)
    if not isinstance(tree, dict):
        raise InputError(f"{path} holds no dictionary, as EMDB documents it")
    return tree
