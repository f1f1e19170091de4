"""What a finished run found, written as other programs write it and brought along again, gives the same motion."""

import json
import os
import struct
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import cv2
import numpy as np
import pytest
import zarr
from PIL import Image
from short_clip import ROOT

from humanmm.cli import main
from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.body.landmarks import load_landmarks
from humanmm.models.geometry.alignment import umeyama_alignment
from humanmm.models.geometry.projection import project, world_to_camera
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.records.landmarks import COCO_LANDMARKS, INDEX
from humanmm.storage.readers.given.bodies import MHR70

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1200)]

FAST = ["--deliver.overlay-max-side-px", "160", "--deliver.scene-max-s", "0"]


class Own:
    """The main person of a run as other programs would see him: in the picture and in camera axes."""

    def __init__(self, run: Path) -> None:
        self.run = run
        motion = zarr.open_group(run / "motion.zarr", mode="r")
        self.record = json.loads((run / "run.json").read_text())
        person: Mapping[str, np.ndarray] = {
            name: np.asarray(motion[f"people/00/{name}"])
            for name in ("frame", "joints", "root_orient", "body_pose", "betas")
        }
        self.frame, self.joints, self.body_pose = person["frame"], person["joints"], person["body_pose"]
        R, t = (np.asarray(motion[f"cameras/{name}"])[self.frame] for name in ("R_world_cam", "t_world_cam"))
        self.K = np.asarray(motion["cameras/K"])[self.frame].astype(np.float64)
        R_world_root = rotvec_to_rotmat(person["root_orient"].astype(np.float64))
        rest = load_body().rest_joints(person["betas"])
        joints, R_joints = forward_kinematics(rest, R_world_root, self.body_pose, self.joints[:, 0])
        points = load_landmarks().place(person["betas"], joints, R_joints)
        self.landmarks_cam = world_to_camera(points, R, t)
        self.pixels = project(self.landmarks_cam, self.K, near_m=0.3)
        self.size = (self.record["video"]["width"], self.record["video"]["height"])

    @property
    def boxes(self) -> np.ndarray:
        """(N, 4) left, top, width, height."""
        low, high = self.pixels.min(axis=1), self.pixels.max(axis=1)
        return np.concatenate([low - 3, high - low + 6], axis=1)


def _gvhmr(own: Own, folder: Path) -> list[str]:
    assert main(["export", str(own.run), "--format", "gvhmr", "--out", str(folder / "gvhmr")]) == 0
    return ["--hmr-from", "gvhmr/person_00.pt"]


def _sam_3d_body(own: Own, folder: Path) -> list[str]:
    points = np.zeros((len(own.frame), 70, 3))
    for name, number in MHR70.items():
        points[:, number] = own.landmarks_cam[:, INDEX[name]]
    focal, away = own.K[:, 0, 0], np.zeros((len(own.frame), 3))
    np.savez(folder / "mhr.npz", pred_keypoints_3d=points, pred_cam_t=away, focal_length=focal, frame=own.frame)
    return ["--hmr-from", "mhr.npz"]


def _openpose(own: Own, folder: Path) -> list[str]:
    (folder / "openpose").mkdir(exist_ok=True)
    order = (0, 15, 14, 17, 16, 5, 2, 6, 3, 7, 4, 11, 8, 12, 9, 13, 10)
    for frame, pixels in zip(own.frame, own.pixels[:, list(COCO_LANDMARKS)], strict=True):
        points = np.zeros((18, 3))
        points[list(order)] = np.c_[pixels - 0.5, np.full(17, 0.9)]  # as OpenCV numbers them
        tree = {"version": 1.3, "people": [{"person_id": [-1], "pose_keypoints_2d": points.ravel().tolist()}]}
        (folder / "openpose" / f"film_{frame:012d}_keypoints.json").write_text(json.dumps(tree))
    return ["--keypoints-from", "openpose"]


def _mot(own: Own, folder: Path) -> list[str]:
    rows = zip(own.frame, own.boxes, strict=True)
    lines = [f"{frame + 1},1,{','.join(f'{side:.2f}' for side in box)},0.9,1,1" for frame, box in rows]
    (folder / "mot.txt").write_text("\n".join(lines))
    return ["--detections-from", "mot.txt"]


def _masks(own: Own, folder: Path) -> list[str]:
    (folder / "masks").mkdir(exist_ok=True)
    thick = max(4, round(0.12 * float(np.median(own.boxes[:, 3]))))
    for frame, pixels in zip(own.frame, own.pixels, strict=True):
        labels = np.zeros((own.size[1], own.size[0]), np.uint8)
        for a, b in ((11, 13), (13, 15), (12, 14), (14, 16), (23, 25), (25, 27), (24, 26), (26, 28), (11, 12), (0, 11)):
            cv2.line(labels, pixels[a].astype(int).tolist(), pixels[b].astype(int).tolist(), 1, thick)
        cv2.fillConvexPoly(labels, pixels[[11, 12, 24, 23]].astype(int), 1)
        Image.fromarray(labels).save(folder / "masks" / f"{frame:05d}.png")
    return ["--masks-from", "masks"]


def _tum(own: Own, folder: Path) -> list[str]:
    assert main(["export", str(own.run), "--format", "tum", "--out", str(folder / "tum")]) == 0
    for index in (folder / "tum").glob("*.json"):
        index.unlink()
    for path in (folder / "tum").rglob("*.tum"):
        path.rename(folder / "tum" / f"{path.stem}.txt")
    return ["--cameras-from", "tum"]


def _colmap_binary(own: Own, folder: Path) -> list[str]:
    """As `colmap model_converter` writes it, of the text model that we export."""
    assert main(["export", str(own.run), "--format", "colmap", "--out", str(folder / "text")]) == 0
    text = next((folder / "text").rglob("images.txt")).parent
    (folder / "sparse").mkdir(exist_ok=True)
    cameras = [line.split() for line in (text / "cameras.txt").read_text().splitlines() if line[:1] not in ("#", "")]
    lines = [line for line in (text / "images.txt").read_text().splitlines() if not line.startswith("#")]
    images = [line.split() for line in lines[::2]]
    numbers = {"SIMPLE_PINHOLE": 0, "PINHOLE": 1}
    packed = [struct.pack("<Q", len(cameras))]
    for number, lens, width, height, *parameters in cameras:
        packed.append(struct.pack("<iiQQ", int(number), numbers[lens], int(width), int(height)))
        packed.append(struct.pack(f"<{len(parameters)}d", *map(float, parameters)))
    (folder / "sparse/cameras.bin").write_bytes(b"".join(packed))
    packed = [struct.pack("<Q", len(images))]
    for number, *pose, camera, name in images:
        packed.append(struct.pack("<i7di", int(number), *map(float, pose), int(camera)))
        packed.append(name.encode() + b"\0" + struct.pack("<Q", 0))
    (folder / "sparse/images.bin").write_bytes(b"".join(packed))
    return ["--cameras-from", "sparse"]


KINDS: dict[str, tuple[Callable[[Own, Path], list[str]], float, float]] = {
    "GVHMR's bodies": (_gvhmr, 20, 12),
    "SAM 3D Body's places": (_sam_3d_body, 30, 20),
    "OpenPose's keypoints": (_openpose, 80, 65),
    "a tracker's boxes": (_mot, 60, 40),
    "masks": (_masks, 60, 40),
    "TUM trajectories": (_tum, 0.1, 0.1),
    "a binary COLMAP model": (_colmap_binary, 0.1, 0.1),
}
"""Writer, and how far joints may lie from the run's own on average, mm: after one rigid motion of the whole path, and
after one of every frame. Bodies hold everything; places lack the twist of the limbs; keypoints lack the depth; boxes
and masks are looked at again by the pose network, which sees the picture in other crops."""


@pytest.mark.parametrize("kind", KINDS)
def test_a_run_of_its_own_results_gives_the_same_motion(kind: str, recovered_film: Path) -> None:
    write, path_mm, pose_mm = KINDS[kind]
    own = Own(recovered_film / "run")
    focal = ["--focal-px", str(own.record["focal"]["px"])]
    if write in (_tum, _colmap_binary):  # the same focal length from the beginning, else the fits differ by that
        own = Own(_recover(recovered_film, "known", focal))
    flags = write(own, recovered_film)
    if write is not _colmap_binary:
        flags += focal
    out = _recover(recovered_film, f"brought-{write.__name__}", flags)
    config = json.loads((out / "run.json").read_text())["config"]
    section = "intrinsics" if "--cameras-from" in flags else "people"
    assert len(config[section][flags[0].strip("-").replace("-", "_")]["sha256"]) == 64

    motion = zarr.open_group(out / "motion.zarr", mode="r")
    frame = np.asarray(motion["people/00/frame"])
    both, rows, own_rows = np.intersect1d(frame, own.frame, return_indices=True)
    assert len(both) >= 0.95 * len(own.frame)
    found, expected = np.asarray(motion["people/00/joints"], np.float64)[rows], own.joints[own_rows].astype(np.float64)
    off_path = np.linalg.norm(_moved(found, expected) - expected, axis=-1).mean() * 1000
    one_by_one = [_moved(a, b) - b for a, b in zip(found, expected, strict=True)]
    off_pose = np.linalg.norm(one_by_one, axis=-1).mean() * 1000
    assert off_path < path_mm and off_pose < pose_mm, f"path {off_path:.1f} mm, pose {off_pose:.1f} mm"


def _recover(folder: Path, out: str, flags: list[str]) -> Path:
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src"), "HUMANMM_STORE": str(folder / "store")}
    done = subprocess.run(
        [sys.executable, "-m", "humanmm.cli", "recover", "film.mp4", "--out", out, *flags, *FAST],
        env=environment, cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return folder / out


def _moved(found: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """The points after the rigid motion that brings them nearest."""
    a, b = found.reshape(-1, 3), expected.reshape(-1, 3)
    return umeyama_alignment(a, b, with_scale=False).apply(a).reshape(found.shape)
