"""The two BlazePose networks on LiteRT: where people are, and 33 landmarks with a mask for one person's crop.

Outputs are decoded to source pixels (centres at (0.5, 0.5)). Interpreters are built once per process and lent to one
caller at a time, so that stages of one video may run in several threads.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from threading import Lock

import cv2
import numpy as np
from ai_edge_litert.interpreter import Interpreter
from jaxtyping import Float

from humanmm.models.geometry.boxes import box_iou
from humanmm.models.perception.interfaces import Detection, Landmarks, Networks
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import Region, body_region, transform
from humanmm.models.records import landmarks
from humanmm.models.records.tracks import MASK_SIDE
from humanmm.models.weights.shipped import read_weights

DETECTOR_SIDE = 224
LANDMARK_SIDE = 256
_VALUES_PER_LANDMARK = 5
_AUXILIARY = slice(33, 35)
"""Landmarks 33 and 34 are no body parts: hip centre and a point on the circle that holds the body."""


_BUILDING = Lock()
"""One interpreter is built at a time in the process: standard error is redirected meanwhile."""


class InterpreterPool:
    """Interpreters of one model; results do not depend on the number of threads."""

    def __init__(self, model: bytes, threads: int) -> None:
        self._model, self._threads = model, threads
        self._idle: list[Interpreter] = []
        self._lock = Lock()
        self.index_of: dict[str, int] = {}
        """Number of every input and output by its name; known once an interpreter was lent."""

    @contextmanager
    def lend(self) -> Iterator[Interpreter]:
        """An interpreter for the caller alone; a new one is built when all are lent."""
        with self._lock:
            interpreter = self._idle.pop() if self._idle else None
        if interpreter is None:
            with _BUILDING, _without_greeting():
                interpreter = Interpreter(model_content=self._model, num_threads=self._threads)
                interpreter.allocate_tensors()
            tensors = [*interpreter.get_input_details(), *interpreter.get_output_details()]
            self.index_of = {tensor["name"]: tensor["index"] for tensor in tensors}
        try:
            yield interpreter
        finally:
            with self._lock:
                self._idle.append(interpreter)


@contextmanager
def _without_greeting() -> Iterator[None]:
    """Keep the runtime's own line about its delegate, for which it has no switch, off standard error."""
    try:
        kept = os.dup(2)
    except OSError:  # standard error is closed
        yield
        return
    silent = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(silent, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(silent)


@lru_cache(maxsize=4)
def _pool(name: str) -> InterpreterPool:
    return InterpreterPool(read_weights(name), threads=min(2, len(os.sched_getaffinity(0))))


def _run(name: str, tensor: Float[np.ndarray, "1 side side 3"], *wanted: str) -> list[np.ndarray]:
    """The wanted outputs of one inference, by tensor name (the landmark network also has a large heatmap)."""
    pool = _pool(name)
    with pool.lend() as interpreter:
        interpreter.set_tensor(pool.index_of["input_1"], tensor)
        interpreter.invoke()
        return [interpreter.get_tensor(pool.index_of[output]) for output in wanted]


def _sigmoid(x: np.ndarray) -> np.ndarray:
    result: np.ndarray = 1 / (1 + np.exp(-np.clip(x, -80, 80)))
    return result


@lru_cache(maxsize=1)
def _anchors() -> Float[np.ndarray, "2254 2"]:
    """Centres of the detector's anchors in input pixels: two at 28², two at 14², six at 7² (three layers of two)."""
    centres = []
    for cells, repeat in ((28, 2), (14, 2), (7, 6)):
        axis = (np.arange(cells) + 0.5) * (DETECTOR_SIDE / cells)
        y, x = np.meshgrid(axis, axis, indexing="ij")
        centres.append(np.repeat(np.stack([x, y], axis=-1).reshape(-1, 2), repeat, axis=0))
    return np.concatenate(centres)


def detect(image: Picture, within: Region, *, threshold: float = 0.5) -> list[Detection]:
    """People in an upright square region of the picture, best first, one detection a person."""
    picture = image.crop(within, DETECTOR_SIDE)
    tensor = np.divide(picture[None], np.float32(127.5), dtype=np.float32) - np.float32(1)
    boxes_and_points, logits = _run("pose_detection.tflite", tensor, "Identity", "Identity_1")
    scores = _sigmoid(logits[0, :, 0])
    chosen = np.flatnonzero(scores >= threshold)
    if not len(chosen):
        return []
    raw = boxes_and_points[0, chosen]
    anchors = _anchors()[chosen]
    boxes = np.concatenate([raw[:, :2] + anchors - raw[:, 2:4] / 2, raw[:, :2] + anchors + raw[:, 2:4] / 2], axis=1)
    points = raw[:, 4:8].reshape(-1, 2, 2) + anchors[:, None]
    to_source = within.to_source(DETECTOR_SIDE)
    found = []
    for members in _overlapping_groups(boxes, scores[chosen]):
        # The networks were trained for the weighted mean of overlapping detections, not for the best one alone.
        weights = scores[chosen][members] / scores[chosen][members].sum()
        hip, rim = transform(to_source, np.tensordot(weights, points[members], axes=1))
        corners = transform(to_source, (weights @ boxes[members]).reshape(2, 2))
        found.append(Detection(float(scores[chosen][members].max()), body_region(hip, rim), corners.reshape(4)))
    return found


def _overlapping_groups(boxes: np.ndarray, scores: np.ndarray, overlap: float = 0.3) -> list[np.ndarray]:
    """Indices of boxes that belong together: each best box with all that overlap it (weighted suppression)."""
    rest, groups = np.argsort(-scores, kind="stable"), []
    while len(rest):
        same = box_iou(boxes[rest[0]], boxes[rest]) > overlap
        same[0] = True
        groups.append(rest[same])
        rest = rest[~same]
    return groups


def locate(image: Picture, region: Region, *, mirrored: bool = False) -> Landmarks:
    """Landmarks and mask of the person that fills a region; `mirrored` shows the network the crop's mirror image.

    Landmarks of a mirrored crop are given in the unmirrored picture, with left and right named as seen there.
    """
    picture = image.crop(region, LANDMARK_SIDE)
    if mirrored:
        picture = np.ascontiguousarray(picture[:, ::-1])
    image_points, presence, mask_logits, world_points = _run(
        "pose_landmark_full.tflite", np.divide(picture[None], np.float32(255), dtype=np.float32),
        "Identity", "Identity_1", "Identity_2", "Identity_4",
    )  # fmt: skip
    raw = image_points.reshape(-1, _VALUES_PER_LANDMARK)
    world = world_points.reshape(-1, 3)[: landmarks.NUM_LANDMARKS].astype(np.float64)
    logits = mask_logits[0, :, :, 0]
    points, visibility = raw[:35, :2].astype(np.float64), _sigmoid(raw[: landmarks.NUM_LANDMARKS, 3])
    if mirrored:
        points = np.column_stack([LANDMARK_SIDE - points[:, 0], points[:, 1]])
        points[: landmarks.NUM_LANDMARKS] = points[landmarks.SWAP]
        world = (world * [-1, 1, 1])[landmarks.SWAP]
        visibility, logits = visibility[landmarks.SWAP], logits[:, ::-1]
    in_source = transform(region.to_source(LANDMARK_SIDE), points)
    c, s = np.cos(region.angle), np.sin(region.angle)
    rotated = np.column_stack([c * world[:, 0] - s * world[:, 1], s * world[:, 0] + c * world[:, 1], world[:, 2]])
    mask = cv2.resize(np.ascontiguousarray(logits), (MASK_SIDE, MASK_SIDE), interpolation=cv2.INTER_AREA)
    return Landmarks(
        keypoints=np.column_stack([in_source[: landmarks.NUM_LANDMARKS], visibility]),
        landmarks3d=rotated,
        presence=float(presence.item()),
        mask=(255 * _sigmoid(mask)).astype(np.uint8),
        region=region,
        next_region=body_region(*in_source[_AUXILIARY]),
    )


BLAZEPOSE = Networks(detect, locate)
