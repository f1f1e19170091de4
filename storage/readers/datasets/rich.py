"""RICH as its owners hand it out. Experimental: layout, keys and frames are known from the owners' own toolkit alone.

A folder with
    bodies/<split>/<sequence>/<frame>/<subject>.pkl       SMPL-X: betas (1,10), global_orient (1,3), body_pose (1,63),
                                                          transl (1,3), in the axes of the multi-camera calibration
    images/<split>/<sequence>/cam_<NN>/<frame>_<NN>.*     bmp, png or jpeg; 30 fps
    scan_calibration/<scene>/calibration/<NNN>.xml        CameraMatrix (3,4), Intrinsics (3,3) of a static camera
    multicam2world/<scene>_multicam2world.json            p_world = c p R + t for rows p; world z up, the scan's axes
where a sequence is called <scene>_<subject>[_<subject>]_<action>. It holds no joints: they come from the user's own
SMPL-X models of men and women. Cameras that move have no calibration and are left out.
"""

import json
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
from jaxtyping import Bool, Float

from humanmm.errors import InputError
from humanmm.models.benchmark.recordings import ImageRecording
from humanmm.models.body.smpl_joints import SmplJoints
from humanmm.models.evaluation.skeleton import SMPL_NAMES
from humanmm.models.geometry.axes import centred_pixels
from humanmm.models.geometry.projection import project
from humanmm.models.geometry.rotations import nearest_rotation
from humanmm.storage.readers.restricted_pickle import read_pickle

log = logging.getLogger(__name__)

FPS = 30.0
WOMEN = (9, 10, 12, 13, 16, 17, 18, 19, 21)
"""Subjects, from the owners' toolkit; the others are men."""
OBTAIN = (
    "get RICH (rich.is.tue.mpg.de, its licence): the bodies and images of a split, scan_calibration and multicam2world"
)
_PARAMETERS = {"global_orient": 3, "body_pose": 63, "betas": 10, "transl": 3}
_HANDS = 6
"""Numbers of SMPL's two hands, which SMPL-X poses finger by finger."""
_IN_VIEW = 0.3
"""Least fraction of joints inside the picture with which a person counts as observed."""
_NOT_WHOLE = 0.15
"""How far a picture's size may be from a whole fraction of the calibrated one."""


@dataclass(frozen=True)
class View:
    """One static camera's pictures of one sequence."""

    bodies: Path
    pictures: Path
    calibration: Path
    world: Path

    @property
    def name(self) -> str:
        return f"{self.bodies.name}_{self.pictures.name}"


@dataclass(frozen=True)
class Models:
    """The user's SMPL-X, by sex: RICH's shapes are of these, not of the neutral model."""

    women: SmplJoints
    men: SmplJoints


def views(root: Path, split: str) -> list[View]:
    """Every view of a split by a static camera, by name."""
    sequences = [path for path in sorted((root / "bodies" / split).glob("*")) if path.is_dir()]
    if not sequences:
        raise InputError(f"{root / 'bodies' / split} holds no sequences; {OBTAIN}")
    found = []
    for bodies in sequences:
        scene = bodies.name.split("_", 1)[0]
        pictures = root / "images" / split / bodies.name
        if not pictures.is_dir():
            raise InputError(f"{pictures} is missing; {OBTAIN}")
        for folder in sorted(pictures.glob("cam_*")):
            number = int(folder.name.removeprefix("cam_"))
            calibration = root / "scan_calibration" / scene / "calibration" / f"{number:03d}.xml"
            if not calibration.is_file():
                log.warning("%s: left out, %s is missing (a camera that moves has none)", folder, calibration)
                continue
            found.append(View(bodies, folder, calibration, root / "multicam2world" / _world_name(bodies.name)))
    if not found:
        raise InputError(f"no camera of {root / 'images' / split} has a file in scan_calibration; {OBTAIN}")
    return found


def _world_name(sequence: str) -> str:
    scene = sequence.split("_", 1)[0]
    if scene == "LectureHall":  # was scanned twice
        scene += "_chair" if "wiping" in sequence else "_yoga"
    return f"{scene}_multicam2world.json"


def read_recording(view: View, models: Models) -> ImageRecording:
    """One view with all its people, whose joints are NaN in frames without parameters."""
    pictures = _pictures(view.pictures)
    parameters = _parameters(view.bodies, set(pictures))
    numbers = np.array([n for n in sorted(pictures) if min(map(min, parameters.values())) <= n])
    numbers = numbers[numbers <= max(map(max, parameters.values()))]
    steps = np.unique(np.diff(numbers))
    if len(steps) != 1:
        raise InputError(f"{view.pictures}: frames are {steps} apart, expected one step throughout; {OBTAIN}")
    K, R_cam_rig, t_cam_rig = _calibration(view.calibration)
    shown = cv2.imread(str(pictures[int(numbers[0])]))
    if shown is None:
        raise InputError(f"{pictures[int(numbers[0])]} cannot be read as a picture")
    K = _at_size(K, shown.shape[1], shown.shape[0], view)
    R_world_rig, t_world_rig = _world(view.world)
    _check_upright(view, R_world_rig)
    people, observed = [], []
    for subject, frames in sorted(parameters.items()):
        joints = np.full((len(numbers), len(SMPL_NAMES), 3), np.nan)
        rows = np.flatnonzero(np.isin(numbers, list(frames)))
        joints[rows] = _posed(models, subject, [frames[int(number)] for number in numbers[rows]])
        observed.append(_in_view(joints @ R_cam_rig.T + t_cam_rig, K, shown.shape[1], shown.shape[0]))
        people.append(joints @ R_world_rig.T + t_world_rig)
    centre = R_world_rig @ (-R_cam_rig.T @ t_cam_rig) + t_world_rig
    return ImageRecording(
        name=view.name,
        fps=FPS / float(steps[0]),
        pictures=tuple(pictures[int(number)] for number in numbers),
        joint_names=SMPL_NAMES,
        people=tuple(people),
        observed=tuple(observed),
        K=K,
        R_world_cam=np.tile(R_world_rig @ R_cam_rig.T, (len(numbers), 1, 1)),
        t_world_cam=np.tile(centre, (len(numbers), 1)),
    )


def _pictures(folder: Path) -> dict[int, Path]:
    """Pictures by the number of their frame."""
    return {
        int(path.stem.split("_")[0]): path
        for path in sorted(folder.iterdir())
        if path.suffix.lower() in (".bmp", ".png", ".jpg", ".jpeg")
    }


def _parameters(folder: Path, known: set[int]) -> dict[int, dict[int, Mapping[str, np.ndarray]]]:
    """SMPL-X parameters by subject and frame, of frames that have a picture."""
    found: dict[int, dict[int, Mapping[str, np.ndarray]]] = {}
    for path in sorted(folder.glob("*/*.pkl")):
        if not path.stem.isdigit() or int(path.parent.name) not in known:
            continue
        tree = read_pickle(path)
        if not isinstance(tree, dict):
            raise InputError(f"{path} holds no dictionary, as RICH's toolkit has it")
        sizes = {key: np.size(tree[key]) if key in tree else None for key in _PARAMETERS}
        if sizes != _PARAMETERS:
            raise InputError(f"{path}: parameters have sizes {sizes}, expected {_PARAMETERS}")
        values = {key: np.asarray(tree[key], np.float64).ravel() for key in _PARAMETERS}
        found.setdefault(int(path.stem), {})[int(path.parent.name)] = values
    if sum(len(frames) for frames in found.values()) < 2:
        raise InputError(f"{folder} holds no <frame>/<subject>.pkl for two of the pictures; {OBTAIN}")
    return found


def _posed(models: Models, subject: int, parameters: Sequence[Mapping[str, np.ndarray]]) -> Float[np.ndarray, "n 24 3"]:
    stacked = {key: np.stack([one[key] for one in parameters]) for key in _PARAMETERS}
    body_pose = np.concatenate([stacked["body_pose"], np.zeros((len(parameters), _HANDS))], axis=1)
    body = models.women if subject in WOMEN else models.men
    return body.posed(stacked["global_orient"], body_pose, stacked["betas"].mean(axis=0), stacked["transl"])


def _calibration(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """K, and rotation and translation from the rig to the camera. The lens's distortion is left out."""
    try:
        tree = ElementTree.parse(path)
        matrices = [
            np.array([float(number) for number in (tree.findtext(f"./{name}/data") or "").split()]).reshape(shape)
            for name, shape in (("Intrinsics", (3, 3)), ("CameraMatrix", (3, 4)))
        ]
    except (OSError, ElementTree.ParseError, ValueError) as error:
        raise InputError(f"{path} holds no CameraMatrix and Intrinsics ({error}); {OBTAIN}") from None
    K, pose = matrices
    return centred_pixels(K), pose[:, :3], pose[:, 3]


def _at_size(K: Float[np.ndarray, "3 3"], width: int, height: int, view: View) -> Float[np.ndarray, "3 3"]:
    """K of pictures that may have been made smaller; the calibrated size is about twice the principal point."""
    ratios = 2 * K[:2, 2] / (width, height)
    shrink = max(1, round(float(ratios.mean())))
    if np.abs(ratios / shrink - 1).max() > _NOT_WHOLE:
        raise InputError(
            f"{view.pictures} holds pictures of {width} x {height}, {view.calibration} is of about "
            f"{2 * K[0, 2]:.0f} x {2 * K[1, 2]:.0f}: not a whole fraction of it"
        )
    return np.asarray(np.diag([1 / shrink, 1 / shrink, 1.0]) @ K)


def _world(path: Path) -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, "3"]]:
    """Rotation and translation from the rig to the upright world, in the rig's metres: the scan's scale is left out."""
    try:
        tree = json.loads(path.read_text(encoding="utf-8"))
        R = np.asarray(tree["R"], np.float64).reshape(3, 3).T
        shift = np.asarray(tree["t"], np.float64).reshape(3) / float(tree["c"])
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(f"{path} is missing or holds no R, t and c ({error}); {OBTAIN}") from None
    R_world_rig: np.ndarray = nearest_rotation(R)  # some have three decimals
    return R_world_rig, shift


def _check_upright(view: View, R_world_rig: Float[np.ndarray, "3 3"]) -> None:
    """Cameras are mounted upright by and large: down in the picture, their mean, must be down in the world."""
    rotations = [_calibration(path)[1] for path in sorted(view.calibration.parent.glob("*.xml"))]
    down = R_world_rig @ np.mean([R_cam_rig[1] for R_cam_rig in rotations], axis=0)
    if down[2] > -0.5 * np.linalg.norm(down):
        raise InputError(f"{view.world}: the cameras of {view.calibration.parent} do not stand upright in a world z up")


def _in_view(
    joints_cam: Float[np.ndarray, "F 24 3"], K: Float[np.ndarray, "3 3"], width: int, height: int
) -> Bool[np.ndarray, "F"]:
    pixels = project(joints_cam, K, near_m=1e-6)
    inside = (joints_cam[..., 2] > 0) & (pixels > 0).all(axis=-1) & (pixels < (width, height)).all(axis=-1)
    return np.asarray(inside.mean(axis=1) >= _IN_VIEW)
