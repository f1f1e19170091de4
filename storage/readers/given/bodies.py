"""Bodies that another system found, in the axes of its camera, as `GivenBody`.

| system | file | keys that are read | body |
|---|---|---|---|
| GVHMR | hmr4d_results.pt | smpl_params_incam: global_orient, body_pose (F,63), transl; K_fullimg (F,3,3) | SMPL-X |
| GEM (with SMPL bodies) | smpl_params.pt | body_params_incam: the same; K_fullimg | SMPL-X |
| PromptHMR | results.pkl (joblib) | people[]: smplx_cam (pose (N,66+), trans), frames; camera: focal, centre | SMPL-X |
| WHAM | wham_output.pkl (joblib) | of each track: pose (N,72), trans (N,3), frame_ids (N,) | SMPL |
| TRAM | .npz, as in `readers.systems` | pred_rotmat (N,24,3,3), pred_trans, frame, img_focal, img_center | SMPL |
| SLAHMR | …_world_results.npz | root_orient (B,T,3), pose_body, trans; cam_R (B,T,3,3), cam_t; intrins (4,) | SMPL-H |
| SAM 3D Body | .npz (*) | pred_keypoints_3d (N,70,3), pred_cam_t (N,3), focal_length, frame, person (N,) | places |
| GEM-X | .npz (*) | soma_joints (F,77,3) or (F,78,3), metres in the axes of the camera; K_fullimg (F,3,3) | places |

(*) They write none themselves: what SAM 3D Body returns of each person, stacked; the joints that GEM-X's body model
gives for its result (docs/bring.md has the lines). Of MHR's and SOMA's rotations none are read: their joints are
others than SMPL's.

Betas are not read: SMPL's shape basis is not here. `height_m` beside the rest (in a pickle in each person or track, of
SLAHMR one for each) is how tall the system's own body stands, which its own environment knows (docs/bring.md).

`transl` moves the body's origin; the pelvis lies SMPL's rest pelvis beside it. WHAM's camera is the one that it assumes
without a calibration: the picture's diagonal for its focal length. All see the pixels that OpenCV reads, those that are
stored, and take them for square; where they are not, K is brought into square pixels, so that a body lies where it lay.
A file is of the whole video, or of a clip of it: its name then ends in @ and the clip's first frame
(`walk@000120.pt`). Written from what the projects publish; no file that one of them wrote was at hand: experimental.
"""

import io
import re
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache, partial
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from humanmm.config import GivenFile
from humanmm.errors import InputError
from humanmm.models.body.smpl_joints import SMPL_REST_PELVIS, SMPLX_REST_PELVIS
from humanmm.models.geometry.intrinsics import K_from_focal
from humanmm.models.geometry.projection import project
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.perception.tracking.given_bodies import GivenBody, smpl_body
from humanmm.models.records.foreign_arrays import frame_numbers, numbers, rotations, shown, whole_numbers
from humanmm.models.records.landmarks import HIPS, INDEX, NUM_LANDMARKS
from humanmm.models.records.video import PictureSizes
from humanmm.storage.readers.archives import NpzArrays, damage
from humanmm.storage.readers.restricted_pickle import load_pickle
from humanmm.storage.readers.torch_tensors import read_tensors

Array = np.ndarray
Tree = Mapping[str, Any]

MAX_EXTRA_FRAMES = 2
"""Decoders disagree about the last frames of a video."""
OTHER_SHAPE = 0.03
"""By how much the sides of the system's pictures may differ in their proportion from the video's."""
MAX_OFF_PX = 0.02
"""How far a keypoint in space may be projected beside the same in the picture, median, in sides of the picture."""
MHR70 = {
    "nose": 0, "left_eye": 1, "right_eye": 2, "left_ear": 3, "right_ear": 4, "left_shoulder": 5, "right_shoulder": 6,
    "left_elbow": 7, "right_elbow": 8, "left_hip": 9, "right_hip": 10, "left_knee": 11, "right_knee": 12,
    "left_ankle": 13, "right_ankle": 14, "left_foot_index": 15, "left_heel": 17, "right_foot_index": 18,
    "right_heel": 20, "right_index": 28, "right_pinky": 40, "right_wrist": 41, "left_index": 49, "left_pinky": 61,
    "left_wrist": 62,
}  # fmt: skip
"""Our landmark → its number among MHR's 70 keypoints (SAM 3D Body)."""
SOMA77 = {
    "left_eye": 9, "right_eye": 10, "left_shoulder": 12, "right_shoulder": 40, "left_elbow": 13, "right_elbow": 41,
    "left_wrist": 14, "right_wrist": 42, "left_index": 20, "right_index": 48, "left_pinky": 35, "right_pinky": 63,
    "left_hip": 67, "right_hip": 72, "left_knee": 68, "right_knee": 73, "left_ankle": 69, "right_ankle": 74,
    "left_foot_index": 71, "right_foot_index": 76,
}  # fmt: skip
"""Our landmark → its number among the 77 joints of SOMA's skeleton in the order of GEM-X: Hips first, then spine, head,
left arm, right arm, left leg, right leg. SOMA's own layer has its root before them, 78 in all."""
SOMA_COLUMNS = 3 * 76
SOMA_ADVICE = (
    "it is GEM-X's SOMA body, whose rotations are of other joints; give the places of its joints as an npz instead, "
    "docs/bring.md has the lines that write it"
)
FARTHEST_M = 200.0
"""Whoever is farther away, median of the frames, was given in other units: a pixel shows 20 cm of him."""
HEIGHT_M = (0.5, 2.5)
"""Of a person's body."""
SHANK_M = (0.15, 0.75)
"""Lengths that a shank can have: joints in other units or in another order have others."""


SUFFIXES = (".pt", ".pkl", ".npz")
"""Of a folder, files with other endings are left alone: our own exports lie beside an exports.json."""


@lru_cache(maxsize=1)
def read_bodies(given: GivenFile, num_frames: int, sizes: PictureSizes) -> tuple[GivenBody, ...]:
    """Everybody in a video of so many frames with pictures of such sizes.

    InputError says in one sentence what is wrong.
    """
    try:
        found: list[GivenBody] = []
        contents = {name: content for name, content in given.read().items() if name.endswith(SUFFIXES)}
        if not contents:
            raise InputError("it is no .pt, .pkl or .npz, and no folder of some")
        for name, content in contents.items():
            first, is_clip = _first_frame(name)
            try:
                with damage("it cannot be read as another system's result"):
                    bodies = _read(name, content, sizes, whole=None if is_clip else num_frames)
                    found += [_within(body, first, num_frames) for body in bodies]
            except InputError as error:
                raise InputError(str(error) if name in str(error) else f"{name}: {error}") from error
        if not found:
            raise InputError("it holds nobody")
    except InputError as error:
        words = str(error)
        raise InputError(words if given.path in words else f"{given.path}: {words}") from error
    return tuple(found)


def _first_frame(name: str) -> tuple[int, bool]:
    """The frame of the video at which the file's clip begins, and whether it is of a clip."""
    at = re.search(r"@(\d+)$", name.rsplit(".", 1)[0])
    return (int(at[1]), True) if at else (0, False)


def _from_the_first(count: int, whole: int | None) -> Int[Array, " n"]:
    """Frames of a file that names none: those of the video or clip, all of them."""
    if whole is not None and count < whole - MAX_EXTRA_FRAMES:
        raise InputError(
            f"it has {count} frames and does not say which, the video has {whole}: was the video brought to another "
            "rate? The name of a clip ends in @ and its first frame: clip@000120.pt"
        )
    return np.arange(count)


def _within(body: GivenBody, first: int, num_frames: int) -> GivenBody:
    """The body in frames of the video; what goes a little beyond its end is cut off."""
    frame = body.frame + first
    if not len(frame):
        raise InputError("it holds a person without a frame")
    if frame[-1] >= num_frames + MAX_EXTRA_FRAMES:
        raise InputError(
            f"it holds frames {frame[0]} to {frame[-1]}, the video has {num_frames} (0 to {num_frames - 1}): is it of "
            "another video, or was the video brought to another rate?"
        )
    away_m = float(np.median(np.linalg.norm(body.landmarks_cam[:, list(HIPS)].mean(axis=1), axis=-1)))
    if away_m > FARTHEST_M:
        raise InputError(f"it holds a person {away_m:,.0f} m from the camera; metres expected")
    kept = frame < num_frames
    R_local = None if body.R_local is None else body.R_local[kept]
    return GivenBody(frame[kept], body.landmarks_cam[kept], body.known, body.K[kept], R_local)


def _read(name: str, content: bytes, sizes: PictureSizes, *, whole: int | None) -> Iterator[GivenBody]:
    """`whole`: frames of the video, None for a clip."""
    if name.endswith(".pt"):
        yield _of_tensors(content, sizes, whole)
    elif name.endswith(".pkl"):
        yield from _of_pickle(load_pickle(io.BytesIO(content), name), sizes)
    else:
        arrays = NpzArrays(io.BytesIO(content), name)
        known: dict[str, Callable[[Tree, PictureSizes], Iterator[GivenBody]]] = {
            "pred_rotmat": _tram, "pose_body": partial(_slahmr, whole=whole), "pred_keypoints_3d": _sam_3d_body,
            "soma_joints": partial(_gem_x, whole=whole),
        }  # fmt: skip
        for key, reader in known.items():
            if key in arrays:
                yield from reader(arrays, sizes)
                return
        raise InputError(
            f"holds {', '.join(map(shown, sorted(arrays)[:6])) or 'nothing'}; expected one of {', '.join(known)}"
        )


def _of_tensors(content: bytes, sizes: PictureSizes, whole: int | None) -> GivenBody:
    """GVHMR's and GEM's file, and our own `export --format gvhmr`, which adds frames and body24's shape."""
    tree = read_tensors(
        io.BytesIO(content),
        "smpl_params_incam",
        "body_params_incam",
        "K_fullimg",
        "frame",
        "betas_body24",
        "observed",
        "height_m",
    )
    parameters = tree.get("smpl_params_incam", tree.get("body_params_incam"))
    if not isinstance(parameters, dict):
        raise InputError("it lacks smpl_params_incam (GVHMR) and body_params_incam (GEM): it is of neither")
    pose = numbers(parameters, "body_pose", (None, None), finite=True)
    if pose.shape[1] != 63:
        raise InputError(
            f"body_pose has {pose.shape[1]} columns; expected 63, those of SMPL's body"
            + (f": {SOMA_ADVICE}" if pose.shape[1] == SOMA_COLUMNS else "")
        )
    count = len(pose)
    frame = frame_numbers(tree, "frame", count) if "frame" in tree else _from_the_first(count, whole)
    K = _in_video(numbers(tree, "K_fullimg", (count, 3, 3), finite=True), sizes, "K_fullimg")
    betas = numbers(tree, "betas_body24", (10,), finite=True) if "betas_body24" in tree else None
    seen = np.asarray(tree["observed"], bool) if "observed" in tree else np.ones(count, bool)
    if seen.shape != (count,):
        raise InputError(f"observed has shape {seen.shape}; expected {count}")
    return smpl_body(
        frame[seen],
        rotvec_to_rotmat(numbers(parameters, "global_orient", (count, 3), finite=True))[seen],
        pose.reshape(count, 21, 3)[seen],
        (numbers(parameters, "transl", (count, 3), finite=True) + SMPLX_REST_PELVIS)[seen],
        K[seen],
        betas=betas,
        height_m=_height_m(tree),
    )


def _height_m(tree: Tree) -> float | None:
    """How tall the system's body stands, if somebody wrote it beside its result."""
    if "height_m" not in tree:
        return None
    height_m = float(numbers(tree, "height_m", (), finite=True))
    if not HEIGHT_M[0] <= height_m <= HEIGHT_M[1]:
        raise InputError(f"height_m is {height_m:g}; expected metres, {HEIGHT_M[0]:g} to {HEIGHT_M[1]:g}")
    return height_m


def _of_pickle(tree: Any, sizes: PictureSizes) -> Iterator[GivenBody]:
    if isinstance(tree, dict) and isinstance(tree.get("people"), dict):
        yield from _prompthmr(tree, sizes)
        return
    tracks = [one for one in tree.values() if isinstance(one, dict) and "pose" in one] if isinstance(tree, dict) else []
    if not tracks:
        raise InputError("it holds neither people (PromptHMR) nor tracks with pose (WHAM)")
    for track in tracks:
        pose = numbers(track, "pose", (None, 72), finite=True).reshape(-1, 24, 3)
        trans = numbers(track, "trans", (len(pose), 3), finite=True)
        frame = frame_numbers(track, "frame_ids", len(pose))
        K_seen = K_from_focal(float(np.hypot(*sizes.coded)), *sizes.coded)
        K = sizes.squared(np.tile(K_seen, (len(pose), 1, 1)), sizes.coded)
        R_root, pelvis = rotvec_to_rotmat(pose[:, 0]), trans + SMPL_REST_PELVIS
        yield smpl_body(frame, R_root, pose[:, 1:], pelvis, K, height_m=_height_m(track))


def _prompthmr(tree: Tree, sizes: PictureSizes) -> Iterator[GivenBody]:
    camera = tree.get("camera")
    if not isinstance(camera, dict):
        raise InputError("it lacks camera, which has PromptHMR's focal length")
    for number, person in tree["people"].items():
        parameters = person.get("smplx_cam") if isinstance(person, dict) else None
        if not isinstance(parameters, dict):
            raise InputError(f"person {number} lacks smplx_cam")
        pose = numbers(parameters, "pose", (None, None), finite=True)
        if pose.shape[1] < 66:
            raise InputError(f"pose of person {number} has {pose.shape[1]} columns; expected 66 or more")
        count = len(pose)
        frame = frame_numbers(person, "frames", count)
        pelvis = numbers(parameters, "trans", (count, 3), finite=True) + SMPLX_REST_PELVIS
        R_root, body = rotvec_to_rotmat(pose[:, :3]), pose[:, 3:66].reshape(count, 21, 3)
        K = _focal_and_centre(camera, sizes, count)
        yield smpl_body(frame, R_root, body, pelvis, K, height_m=_height_m(person))


def _tram(arrays: Tree, sizes: PictureSizes) -> Iterator[GivenBody]:
    R = rotations(arrays, "pred_rotmat", (None, 24, 3, 3), finite=True)
    trans = numbers(arrays, "pred_trans", (len(R), 3), finite=True)
    frame = frame_numbers(arrays, "frame", len(R))
    K = _focal_and_centre(arrays, sizes, len(R))
    pose, pelvis = rotmat_to_rotvec(R[:, 1:]), trans + SMPL_REST_PELVIS
    yield smpl_body(frame, R[:, 0], pose, pelvis, K, height_m=_height_m(arrays))


def _slahmr(arrays: Tree, sizes: PictureSizes, *, whole: int | None) -> Iterator[GivenBody]:
    orient = numbers(arrays, "root_orient", (None, None, 3), finite=True)
    tracks, count = orient.shape[:2]
    frame = _from_the_first(count, whole)
    pose = numbers(arrays, "pose_body", (tracks, count, 63), finite=True).reshape(tracks, count, 21, 3)
    trans = numbers(arrays, "trans", (tracks, count, 3), finite=True)
    R_cam = rotations(arrays, "cam_R", (None, count, 3, 3), finite=True)
    t_cam = numbers(arrays, "cam_t", (len(R_cam), count, 3), finite=True)
    fx, fy, cx, cy = numbers(arrays, "intrins", (4,), finite=True)
    K = np.tile(_in_video(np.array([[[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]]]), sizes, "intrins"), (count, 1, 1))
    heights = numbers(arrays, "height_m", (tracks,), finite=True) if "height_m" in arrays else None
    for track in range(tracks):
        R, t = R_cam[min(track, len(R_cam) - 1)], t_cam[min(track, len(R_cam) - 1)]
        pelvis = (R @ (trans[track] + SMPL_REST_PELVIS)[..., None])[..., 0] + t
        own = {"height_m": heights[track]} if heights is not None else {}
        yield smpl_body(frame, R @ rotvec_to_rotmat(orient[track]), pose[track], pelvis, K, height_m=_height_m(own))


def _sam_3d_body(arrays: Tree, sizes: PictureSizes) -> Iterator[GivenBody]:
    """Places of keypoints alone; rows of one person are those with the same number in `person`."""
    points = numbers(arrays, "pred_keypoints_3d", (None, 70, 3), finite=True)
    count = len(points)
    points = points + numbers(arrays, "pred_cam_t", (count, 3), finite=True)[:, None]
    focal_px = numbers(arrays, "focal_length", (count,), finite=True)
    frame = whole_numbers(arrays, "frame", (count,))
    person = whole_numbers(arrays, "person", (count,)) if "person" in arrays else np.zeros(count, np.int64)
    K = np.stack([K_from_focal(max(one, 1.0), *sizes.coded) for one in focal_px]) if count else np.zeros((0, 3, 3))
    if "pred_keypoints_2d" in arrays:
        _check_projection(points, K, numbers(arrays, "pred_keypoints_2d", (count, 70, 2), finite=True), sizes)
    K = sizes.squared(K, sizes.coded)
    landmarks, known = _landmarks(points, MHR70)
    for number in np.unique(person):
        rows = np.flatnonzero(person == number)
        rows = rows[np.argsort(frame[rows], kind="stable")]
        frame_numbers({"frame": frame[rows]}, "frame", len(rows))
        yield GivenBody(frame[rows], landmarks[rows], known, K[rows])


def _gem_x(arrays: Tree, sizes: PictureSizes, *, whole: int | None) -> Iterator[GivenBody]:
    """Places of joints alone, of one person."""
    points = numbers(arrays, "soma_joints", (None, None, 3), finite=True)
    if points.shape[1] not in (77, 78):
        raise InputError(f"soma_joints has {points.shape[1]} joints; expected SOMA's 77, or 78 with its root")
    points, count = points[:, points.shape[1] - 77 :], len(points)
    shank_m = np.linalg.norm(points[:, SOMA77["left_knee"]] - points[:, SOMA77["left_ankle"]], axis=-1)
    if not ((shank_m > SHANK_M[0]) & (shank_m < SHANK_M[1])).all():
        raise InputError(
            f"soma_joints has the left ankle {np.median(shank_m):.3g} from the left knee; expected metres, and the "
            "joints in SOMA's order"
        )
    frame = frame_numbers(arrays, "frame", count) if "frame" in arrays else _from_the_first(count, whole)
    K = _in_video(numbers(arrays, "K_fullimg", (count, 3, 3), finite=True), sizes, "K_fullimg")
    yield GivenBody(frame, *_landmarks(points, SOMA77), K)


def _landmarks(points: Float[Array, "n j 3"], number_of: Mapping[str, int]) -> tuple[Array, Array]:
    """Our landmarks (n, 33, 3) and which of them are known (33,); the others lie between the hips."""
    landmarks, known = np.zeros((len(points), NUM_LANDMARKS, 3)), np.zeros(NUM_LANDMARKS, bool)
    for name, number in number_of.items():
        landmarks[:, INDEX[name]], known[INDEX[name]] = points[:, number], True
    landmarks[:, ~known] = landmarks[:, [INDEX["left_hip"], INDEX["right_hip"]]].mean(axis=1, keepdims=True)
    return landmarks, known


def _check_projection(points: Array, K: Array, pixels: Array, sizes: PictureSizes) -> None:
    off = np.linalg.norm(project(points, K, near_m=0.1) - pixels, axis=-1)
    if len(off) and np.median(off) > MAX_OFF_PX * max(sizes.coded):
        raise InputError(
            f"pred_keypoints_3d + pred_cam_t are projected {np.median(off):.0f} pixels beside pred_keypoints_2d: "
            "is it of a video of another size?"
        )


def _focal_and_centre(tree: Tree, sizes: PictureSizes, count: int) -> Float[Array, "n 3 3"]:
    focal_px = float(numbers(tree, "img_focal", (), finite=True))
    cx, cy = numbers(tree, "img_center", (2,), finite=True)
    K = np.array([[[focal_px, 0, cx], [0, focal_px, cy], [0, 0, 1.0]]])
    return np.tile(_in_video(K, sizes, "img_center"), (count, 1, 1))


def _in_video(K: Float[Array, "n 3 3"], sizes: PictureSizes, key: str) -> Float[Array, "n 3 3"]:
    """K in square pixels of the video, the principal point in its middle: systems work on pictures of their own size,
    of which the middle tells the proportion."""
    cx, cy, fx, fy = K[:, 0, 2], K[:, 1, 2], K[:, 0, 0], K[:, 1, 1]
    if not (np.minimum(np.minimum(cx, cy), np.minimum(fx, fy)) > 0).all():
        raise InputError(f"{key} holds a focal length or a principal point that is not above zero")
    found = {sizes.like(x, y, within=OTHER_SHAPE) for x, y in zip(cx, cy, strict=True)}
    size = found.pop() if len(found) == 1 else sizes.coded if not found else None
    width, height = np.array(size or sizes.coded, np.float64)
    if size is None:
        raise InputError(
            f"{key} has the middle of the picture at ({cx[0]:.0f}, {cy[0]:.0f}), the video at ({width / 2:.0f}, "
            f"{height / 2:.0f}): is it of another video?"
        )
    scale = width / 2 / cx
    scaled = np.zeros_like(K)
    scaled[:, 0, 0], scaled[:, 1, 1], scaled[:, 2, 2] = fx * scale, fy * scale, 1.0
    scaled[:, 0, 2], scaled[:, 1, 2] = width / 2, height / 2
    return sizes.squared(scaled, size)
