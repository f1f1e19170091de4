"""Where people are in the pictures, as another program found: boxes or masks, as `GivenRegions`.

| program | what it writes | frames |
|---|---|---|
| trackers (MOT challenge's layout) | text, `frame, id, left, top, width, height, score, …` a line | from 1 |
| detectors (COCO results) | json: [].image_id, bbox, score, category_id, track_id | image_id, or its last number |
| SAM 2, Cutie, XMem, DAVIS | a png a frame, a pixel's value is the person's number or 0 | last number of its name |

Boxes are left, top, width, height, in the pixels that OpenCV reads: stored ones, upright. Where they are not square,
boxes are brought into the square ones of all stages. Masks may be of either, and smaller.
"""

import io
import json
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from jaxtyping import Float
from PIL import Image, UnidentifiedImageError

from humanmm.config import GivenFile
from humanmm.errors import InputError
from humanmm.models.perception.tracking.given_regions import GivenRegions
from humanmm.models.records.video import PictureSizes
from humanmm.storage.readers.given.frame_names import MAX_EXTRA_FRAMES, doubts, frame_number

Array = np.ndarray

PERSON = 1
"""COCO's category of people."""
MAX_PEOPLE = 255
"""In one picture of masks; one of 16 bits could number 65,535."""
OTHER_SHAPE = 0.01
OUTSIDE = 0.2
"""Share of boxes whose middle may lie outside of the picture."""


@lru_cache(maxsize=1)
def read_detections(given: GivenFile, num_frames: int, sizes: PictureSizes) -> GivenRegions:
    """People's boxes in a video of so many frames with pictures of such sizes.

    InputError says in one sentence what is wrong.
    """
    return _with_name(given, lambda: _detections(given, num_frames, sizes))


@lru_cache(maxsize=1)
def read_masks(given: GivenFile, num_frames: int, sizes: PictureSizes) -> GivenRegions:
    """People's masks, and boxes about them, in the same."""
    return _with_name(given, lambda: _masks(given, num_frames, sizes))


def _with_name(given: GivenFile, read: Callable[[], GivenRegions]) -> GivenRegions:
    try:
        return read()
    except InputError as error:
        words = str(error)
        raise InputError(words if given.path in words else f"{given.path}: {words}") from None


def _detections(given: GivenFile, num_frames: int, sizes: PictureSizes) -> GivenRegions:
    contents = given.read()
    if len(contents) != 1:
        raise InputError(f"it is a folder of {len(contents)} files; expected one, MOT text or COCO results json")
    ((name, content),) = contents.items()
    if name.endswith(".json"):
        rows = _coco_rows(content)
        first = 1 if len(rows) and rows[:, 0].min() == 1 and rows[:, 0].max() == num_frames else 0
    else:
        rows, first = _mot_rows(content), 1
    if not len(rows):
        raise InputError("it holds nobody")
    rows[:, 0] -= first
    warnings = _frame_doubts("boxes", rows[:, 0], num_frames, sure_of_first=not name.endswith(".json"))
    rows = rows[rows[:, 0] < num_frames]
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    box = np.concatenate([rows[:, 2:4], rows[:, 2:4] + rows[:, 4:6]], axis=1)
    if (rows[:, 4:6] <= 0).any():
        raise InputError(f"box {rows[(rows[:, 4:6] <= 0).any(axis=1)][0, 2:6].tolist()} has no width or height")
    middle = (box[:, :2] + box[:, 2:]) / 2
    outside = ((middle < 0) | (middle > np.array(sizes.coded))).any(axis=1).mean()
    if outside > OUTSIDE or box.max() <= 2.0:
        raise InputError(
            f"its boxes are not in pixels of the video's pictures ({sizes.text}): are they fractions, or of a "
            "video of another size?"
        )
    person = rows[:, 1].astype(np.int64)
    _check_once(rows[:, 0].astype(np.int64), person)
    box *= np.tile(sizes.to_square, 2)
    return GivenRegions(rows[:, 0].astype(np.int64), person, box, np.clip(rows[:, 6], 0, 1), warnings=warnings)


def _mot_rows(content: bytes) -> Float[Array, "M 7"]:
    """frame, id (−1: unknown), left, top, width, height, score."""
    rows = []
    for line in content.decode("utf-8", "replace").splitlines():
        if not line.strip() or line.startswith("#"):
            continue
        words = line.replace(",", " ").split()
        try:
            values = [float(word) for word in words[:7]]
        except ValueError:
            values = []
        if len(values) < 6 or not np.isfinite(values).all():
            raise InputError(f"a line reads {line[:80]!r}; expected frame, id, left, top, width, height, score")
        score = values[6] if len(values) > 6 and values[6] >= 0 else 1.0
        rows.append([*values[:6], score])
    return np.array(rows).reshape(-1, 7)


def _coco_rows(content: bytes) -> Float[Array, "M 7"]:
    try:
        tree = json.loads(content)
        rows = [_coco_row(one) for one in tree if one.get("category_id", PERSON) == PERSON]
    except (ValueError, RecursionError, KeyError, TypeError, AttributeError, OverflowError):
        raise InputError(
            "it is no list of COCO results; expected image_id, bbox, score and category_id of each box"
        ) from None
    return np.array(rows, np.float64).reshape(-1, 7)


def _coco_row(one: Any) -> list[float]:
    image = one["image_id"]
    left, top, width, height = (float(value) for value in one["bbox"])
    frame = image if isinstance(image, int) else frame_number(str(image))
    row = [float(frame), float(one.get("track_id", -1)), left, top, width, height, float(one.get("score", 1.0))]
    if not np.isfinite(row).all():
        raise InputError(f"a box reads {one!r}; expected finite numbers")
    return row


def _masks(given: GivenFile, num_frames: int, sizes: PictureSizes) -> GivenRegions:
    contents = given.read()
    others = [name for name in contents if not name.endswith(".png")]
    if others:
        raise InputError(f"{others[0]} is no .png; expected a folder of one png a frame")
    by_number = {frame_number(name): name for name in contents}
    if len(by_number) < len(contents):
        raise InputError("two of its pictures are of one frame; expected one png a frame")
    first = 1 if min(by_number) == 1 and max(by_number) == num_frames else 0
    name_of = {number - first: name for number, name in by_number.items()}
    warnings = _frame_doubts("masks", np.array(list(name_of)), num_frames)
    rows: list[list[float]] = []
    for frame in sorted(frame for frame in name_of if frame < num_frames):
        labels = _labels(name_of[frame], contents[name_of[frame]], sizes)
        to_video = np.array(sizes.square) / (labels.shape[1], labels.shape[0])
        people = np.unique(labels[labels > 0])
        if len(people) > MAX_PEOPLE:
            raise InputError(f"{name_of[frame]} holds {len(people):,} people; expected at most {MAX_PEOPLE}")
        for person in people:
            shape = labels == person
            y, x = np.flatnonzero(shape.any(axis=1)), np.flatnonzero(shape.any(axis=0))
            low, high = np.array([x.min(), y.min()]) * to_video, (np.array([x.max(), y.max()]) + 1) * to_video
            rows.append([frame, int(person), *low, *high])
    if not rows:
        raise InputError("none of its masks holds anybody: every pixel is 0")
    table = np.array(rows)
    frame_of = table[:, 0].astype(np.int64)
    return GivenRegions(
        frame_of,
        table[:, 1].astype(np.int64),
        table[:, 2:6],
        np.ones(len(table)),
        labels=lru_cache(maxsize=4)(
            lambda frame: _labels(name_of[frame], contents[name_of[frame]], sizes) if frame in name_of else None
        ),
        warnings=warnings,
    )


def _labels(name: str, content: bytes, sizes: PictureSizes) -> Array:
    """(height, width), a pixel's number; the numbers themselves where the file has a palette."""
    try:
        with Image.open(io.BytesIO(content), formats=["PNG"]) as picture:
            sides = f"{picture.width}×{picture.height} pixels, the video {sizes.text}"
            size = sizes.like(picture.width, picture.height, within=OTHER_SHAPE)
            if size is None:
                raise InputError(f"{name} has {sides}: is it of another video?")
            if picture.width > size[0]:
                raise InputError(f"{name} has {sides}; expected as many or fewer")
            if picture.mode not in ("1", "L", "P", "I", "I;16"):
                raise InputError(
                    f"{name} has colours ({picture.mode}); expected one number a pixel, grey or with a palette"
                )
            labels = np.asarray(picture).astype(np.int32)
    except (UnidentifiedImageError, OSError, SyntaxError, Image.DecompressionBombError):
        raise InputError(f"{name} is no png, or it is damaged") from None
    return labels


def _frame_doubts(what: str, frame: Array, num_frames: int, *, sure_of_first: bool = False) -> tuple[str, ...]:
    low, high = int(frame.min()), int(frame.max())
    if low < 0 or high >= num_frames + MAX_EXTRA_FRAMES:
        raise InputError(
            f"it holds frames {low} to {high}, counted from 0, the video has {num_frames} (0 to {num_frames - 1}): is "
            "it of another video, or was the video brought to another rate?"
        )
    return doubts(what, low, high, num_frames, sure_of_first=sure_of_first)


def _check_once(frame: Array, person: Array) -> None:
    """Nobody who has a number is in two boxes of one frame."""
    pairs, count = np.unique(np.stack([frame, person], axis=1)[person >= 0], axis=0, return_counts=True)
    if (count > 1).any():
        at, who = pairs[count > 1][0]
        raise InputError(f"person {who} has {count.max()} boxes in frame {at}; expected one")
