"""Keypoints in the picture that another program found, as COCO's 17.

| program | what it writes | frame |
|---|---|---|
| OpenPose (`--write_json`), Sports2D, Pose2Sim | a json a frame: people[].pose_keypoints_2d | last number of its name |
| MMPose (`pred_out_dir`, `--save-predictions`) | one json: [].instances[].keypoints, keypoint_scores | frame_id |
| AlphaPose, COCO results | one json: [].image_id, keypoints | number, or last number of a name |
| COCO annotations | one json: images[], annotations[].keypoints | last number of file_name |

The number of keypoints determines the set: 17, 26 (Halpe), 133 (whole body) and 136 (Halpe whole body) begin with
COCO's 17; 18 are OpenPose's COCO model; 25 are BODY_25, or BODY_25B where the middle of neck and hips lies elsewhere.
Frames count from 0; where the first is 1 and the last one the number of frames, from 1. Pixels are those that OpenCV
reads: stored ones, upright, the first with its centre at (0, 0); half a pixel is added to be in ours. Where they are
not square, keypoints are brought into the square ones of all stages.
"""

import json
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from humanmm.config import GivenFile
from humanmm.errors import InputError
from humanmm.models.perception.interfaces import SEEN
from humanmm.models.perception.tracking.keypoint_tracks import PictureKeypoints
from humanmm.models.records.foreign_arrays import numbers, shown
from humanmm.models.records.video import PictureSizes
from humanmm.storage.readers.given.frame_names import MAX_EXTRA_FRAMES, doubts, frame_number

Array = np.ndarray

FIRST_17 = tuple(range(17))
OPENPOSE_COCO = (0, 15, 14, 17, 16, 5, 2, 6, 3, 7, 4, 11, 8, 12, 9, 13, 10)
BODY_25 = (0, 16, 15, 18, 17, 5, 2, 6, 3, 7, 4, 12, 9, 13, 10, 14, 11)
"""Of COCO's 17 keypoints, in their order, the number in OpenPose's sets."""
SETS = {17: FIRST_17, 18: OPENPOSE_COCO, 26: FIRST_17, 133: FIRST_17, 136: FIRST_17}
"""Number of keypoints → COCO's 17 among them; 25 are looked at."""
BODY_25_MIDDLES = ((1, 2, 5), (8, 9, 12))
"""Neck and mid-hip, each with the two keypoints that it lies between."""
BESIDE = 0.08
"""Fraction of a person's box by which they may lie beside the middle, median."""
LEAST_PX = 2.0
"""Larger side of a person's box below which his keypoints are one place, and show nobody."""
OPENCV_CENTRE = 0.5
"""Pixels from OpenCV's coordinates to ours, which have the centre of the first pixel at (0.5, 0.5): pose networks of
COCO's kind number pixels. OpenPose adds so much itself, other writers of its layout do not: half a pixel is open."""
OUTSIDE, MARGIN = 0.2, 0.1
"""Share of keypoints that may lie further outside the picture than this fraction of its sides."""


@lru_cache(maxsize=1)
def read_keypoints(given: GivenFile, num_frames: int, sizes: PictureSizes) -> PictureKeypoints:
    """Everybody in every frame of a video with pictures of such sizes.

    InputError says in one sentence what is wrong.
    """
    try:
        rows = [row for name, content in given.read().items() for row in _rows(name, content, sizes)]
        frames = _frames([frame for frame, _ in rows], num_frames)
        people = [points for _, points in rows]
        keypoints = _as_coco([points for points in people if points is not None])
        frame = np.array([f for f, points in zip(frames, people, strict=True) if points is not None], np.int64)
        _check_pixels(keypoints, sizes)
        is_place = ((keypoints[..., 2] >= SEEN).sum(axis=1) > 1) & (_box_sides(keypoints) < LEAST_PX)
        if is_place.all():
            raise InputError(f"everybody's keypoints lie within {LEAST_PX:g} pixels: they show nobody")
    except InputError as error:
        words = str(error)
        raise InputError(words if given.path in words else f"{given.path}: {words}") from None
    keypoints[..., :2] = (keypoints[..., :2] + OPENCV_CENTRE) * sizes.to_square
    order = np.argsort(frame, kind="stable")
    order = order[(frame < num_frames)[order] & ~is_place[order]]
    warnings = (*doubts("keypoints", min(frames), max(frames), num_frames), *_places_left_out(frame[is_place]))
    return PictureKeypoints(frame[order], keypoints[order], warnings)


def _places_left_out(frame: Int[Array, " n"]) -> tuple[str, ...]:
    """A warning if somebody has no extent in some frames."""
    if not len(frame):
        return ()
    return (
        f"given keypoints of a person lie all within {LEAST_PX:g} pixels, in {len(np.unique(frame))} frames from "
        f"frame {frame.min()} on: he is left out there",
    )


Row = tuple[int, Float[Array, "K 3"] | None]
"""Frame as the file numbers it, and a person's keypoints; None for a frame, whoever is in it."""


def _rows(name: str, content: bytes, sizes: PictureSizes) -> list[Row]:
    if not name.endswith(".json"):
        raise InputError(f"{name} is no .json file")
    try:
        tree = json.loads(content)
    except (ValueError, RecursionError):
        raise InputError(f"{name} is not json, or holds lists in lists without end") from None
    try:
        return _rows_of(tree, name, sizes)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None
    except KeyError as error:
        missing = shown(repr(error.args[0]))
        raise InputError(f"{name} is laid out like no known program's keypoints: {missing} is missing") from None
    except (TypeError, AttributeError, IndexError, OverflowError, ValueError):
        what = "a frame is no number, or a table or list is something else"
        raise InputError(f"{name} is laid out like no known program's keypoints: {what}") from None


def _rows_of(tree: Any, name: str, sizes: PictureSizes) -> list[Row]:
    match tree:
        case {"people": list(people)}:
            return _openpose(people, frame_number(name))
        case {"instance_info": list(frames)}:
            return _mmpose(frames)
        case [{"instances": _}, *_]:
            return _mmpose(tree)
        case {"annotations": list(annotations), "images": list(images)}:
            _check_declared(images, sizes)
            return _annotations(annotations, images)
        case [{"image_id": _}, *_]:
            return [(_frame_of(one["image_id"]), _triples(one["keypoints"])) for one in tree]
        case [{"keypoints": _, "keypoint_scores": _}, *_] | []:  # MMPose, of one picture
            return [(frame_number(name), None), *((frame_number(name), _scored(one)) for one in tree)]
    raise InputError("it is laid out like no known program's keypoints (OpenPose, MMPose, AlphaPose, COCO)")


def _openpose(people: list[Any], frame: int) -> list[Row]:
    found = [person.get("pose_keypoints_2d", person.get("pose_keypoints")) for person in people]
    return [(frame, None), *((frame, _triples(points)) for points in found if points)]


def _mmpose(frames: list[Any]) -> list[Row]:
    seen: list[Row] = [(int(frame["frame_id"]), None) for frame in frames]
    return seen + [(int(frame["frame_id"]), _scored(one)) for frame in frames for one in frame["instances"]]


def _annotations(annotations: list[Any], images: list[Any]) -> list[Row]:
    """Visibility 2 is seen, 1 hidden: scores 1 and 0.5."""
    number = {image["id"]: frame_number(image["file_name"]) for image in images}
    people = [one for one in annotations if any(one.get("keypoints", ()))]
    seen: list[Row] = [(frame, None) for frame in number.values()]
    return seen + [(number[one["image_id"]], _triples(one["keypoints"]) * [1.0, 1.0, 0.5]) for one in people]


def _check_declared(images: list[Any], sizes: PictureSizes) -> None:
    declared = {(image["width"], image["height"]) for image in images if image.get("width") and image.get("height")}
    others = sorted(declared - {sizes.coded})
    if others:
        width, height = others[0]
        raise InputError(f"its pictures are {width}×{height} pixels, the video {sizes.text}; expected the same size")


def _frame_of(image: Any) -> int:
    return image if isinstance(image, int) else frame_number(image)


def _triples(values: Any) -> Float[Array, "K 3"]:
    flat = np.asarray(values, dtype=object).ravel() if isinstance(values, list) else values
    points = numbers({"keypoints": list(flat)}, "keypoints", (None,))
    if len(points) % 3:
        raise InputError(f"a person has {len(points)} numbers; expected x, y and score of each keypoint")
    return points.reshape(-1, 3)


def _scored(instance: Mapping[str, Any]) -> Float[Array, "K 3"]:
    xy = numbers(instance, "keypoints", (None, 2))
    return np.column_stack([xy, numbers(instance, "keypoint_scores", (len(xy),))])


def _frames(given: list[int], num_frames: int) -> list[int]:
    """From 0 on."""
    if not given:
        raise InputError("it holds no frame")
    first, last = min(given), max(given)
    if first == 1 and last == num_frames:
        return [frame - 1 for frame in given]
    if first < 0 or last >= num_frames + MAX_EXTRA_FRAMES:
        raise InputError(
            f"it holds frames {first} to {last}, the video has {num_frames} (0 to {num_frames - 1}): is it of another "
            "video, or was the video brought to another rate?"
        )
    return given


def _as_coco(people: list[Float[Array, "K 3"]]) -> Float[Array, "M 17 3"]:
    if not people:
        raise InputError("it holds nobody")
    counts = sorted({len(points) for points in people})
    if len(counts) > 1:
        raise InputError(f"people have {' and '.join(map(str, counts))} keypoints; expected one set for all")
    points = np.stack(people)
    unknown = ~np.isfinite(points).all(axis=-1)
    points[unknown] = 0.0
    if counts[0] == 25:
        chosen = BODY_25 if _is_body_25(points) else FIRST_17
    elif counts[0] in SETS:
        chosen = SETS[counts[0]]
    else:
        known = ", ".join(map(str, sorted([*SETS, 25])))
        raise InputError(f"a person has {counts[0]} keypoints; known are the sets of {known}")
    points = points[:, list(chosen)]
    points[..., 2] = np.clip(points[..., 2], 0.0, 1.0)
    return points


def _is_body_25(points: Float[Array, "M 25 3"]) -> bool:
    """Neck and mid-hip lie where BODY_25 has them; BODY_25B has an eye and an elbow there."""
    beside = []
    for middle, a, b in BODY_25_MIDDLES:
        seen = (points[:, [middle, a, b], 2] >= SEEN).all(axis=1)
        side = np.maximum(_box_sides(points[seen]), 1e-9)
        off = np.linalg.norm(points[seen, middle, :2] - (points[seen, a, :2] + points[seen, b, :2]) / 2, axis=1)
        beside.append(off / side)
    together = np.concatenate(beside)
    return not len(together) or float(np.median(together)) <= BESIDE


def _box_sides(points: Float[Array, "M K 3"]) -> Float[Array, " M"]:
    seen = points[..., 2:] >= SEEN
    low = np.where(seen, points[..., :2], np.inf).min(axis=1)
    high = np.where(seen, points[..., :2], -np.inf).max(axis=1)
    return np.asarray((high - low).max(axis=1))


def _check_pixels(keypoints: Float[Array, "M 17 3"], sizes: PictureSizes) -> None:
    size = sizes.coded
    xy = keypoints[keypoints[..., 2] >= SEEN, :2]
    if not len(xy):
        raise InputError(f"no keypoint has a score of {SEEN} or more")
    if np.abs(xy).max() <= 2.0:
        raise InputError("its keypoints are fractions of the picture; expected pixels of the video")
    outside = ((xy < -MARGIN * np.array(size)) | (xy > (1 + MARGIN) * np.array(size))).any(axis=1).mean()
    if outside > OUTSIDE:
        raise InputError(
            f"{100 * outside:.0f} % of its keypoints lie outside of the video's pictures ({sizes.text}): "
            "are they of another video, or of one of another size?"
        )
