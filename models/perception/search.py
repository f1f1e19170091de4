"""Finding everybody in one frame: the detector, the detector again with the found painted out, tiles, and HOG boxes."""

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from jaxtyping import UInt8

from humanmm.models.perception.networks import detect, locate
from humanmm.models.perception.observation import Observation, observe, similarity
from humanmm.models.perception.regions import Region, transform, whole

SETTLE_ROUNDS = 3
DUPLICATE_SIMILARITY = 0.5
_PAINT = (127, 127, 127)


@dataclass(frozen=True)
class Effort:
    """How hard a search looks."""

    tiles: bool
    """Also look at enlarged parts of the frame: people smaller than about a quarter of its height."""


QUICK = Effort(tiles=False)
THOROUGH = Effort(tiles=True)


def find_people(
    image: UInt8[np.ndarray, "height width 3"], known: list[Observation], effort: Effort, *, limit: int
) -> list[Observation]:
    """People in the frame who are not among the known, at most `limit` of them."""
    found: list[Observation] = []
    canvas = image
    if known:
        canvas = image.copy()
        for person in known:
            paint_out(canvas, person)
    candidates = [whole(image)]
    if effort.tiles:
        candidates += tiles(image)
    for place, within in enumerate(candidates):
        for _ in range(limit + 1):
            if len(found) >= limit:
                return found
            fresh = [
                person
                for detection in detect(canvas, within)
                if (person := settle(canvas, detection.region)) is not None
                and not any(same_person(person, other) for other in [*known, *found])
            ]
            fresh = _without_duplicates(fresh)[: limit - len(found)]
            if not fresh:
                break
            found += fresh
            if canvas is image:
                canvas = image.copy()
            for person in fresh:
                paint_out(canvas, person)
    if effort.tiles:
        for region in _upright_boxes(canvas):
            if len(found) >= limit:
                break
            person = settle(canvas, region)
            if person is not None and not any(same_person(person, other) for other in [*known, *found]):
                found.append(person)
                if canvas is image:
                    canvas = image.copy()
                paint_out(canvas, person)
    return found


def settle(image: UInt8[np.ndarray, "height width 3"], region: Region) -> Observation | None:
    """The person in a region, looked at until the crop follows from its own answer."""
    frame_size = (image.shape[1], image.shape[0])
    seen = None
    for _ in range(SETTLE_ROUNDS):
        answer = locate(image, region)
        seen = observe(answer, frame_size)
        if seen is None:
            return None
        region = answer.next_region
    return seen


def same_person(a: Observation, b: Observation) -> bool:
    """True where two observations of one frame show one body."""
    return similarity(a.keypoints, b.keypoints, min(a.region.side, b.region.side)) > DUPLICATE_SIMILARITY


def _without_duplicates(people: list[Observation]) -> list[Observation]:
    kept: list[Observation] = []
    for person in sorted(people, key=lambda p: -p.confidence):
        if not any(same_person(person, other) for other in kept):
            kept.append(person)
    return kept


def paint_out(canvas: UInt8[np.ndarray, "height width 3"], person: Observation) -> None:
    """Cover the person's mask with grey, in place, so that the networks see who else is there."""
    region, size = person.region, person.mask.shape[0]
    grown = cv2.dilate(person.mask, np.ones((5, 5), np.uint8))
    low = np.floor([region.x - 0.75 * region.side, region.y - 0.75 * region.side]).astype(int)
    high = np.ceil([region.x + 0.75 * region.side, region.y + 0.75 * region.side]).astype(int)
    low, high = np.maximum(low, 0), np.minimum(high, [canvas.shape[1], canvas.shape[0]])
    if (high - low).min() <= 0:
        return
    matrix = region.to_source(size)
    matrix[:, 2] += matrix[:, :2] @ np.array([0.5, 0.5]) - 0.5 - low
    covered = cv2.warpAffine(grown, matrix, (int(high[0] - low[0]), int(high[1] - low[1])), flags=cv2.INTER_NEAREST)
    canvas[low[1] : high[1], low[0] : high[0]][covered > 0] = _PAINT


def tiles(image: UInt8[np.ndarray, "height width 3"]) -> list[Region]:
    """Overlapping squares that enlarge parts of the frame: sides of the shorter side, and of its half."""
    height, width = image.shape[:2]
    short, found = min(height, width), []
    for side in (float(short), short / 2):
        if side < 96:
            continue
        columns, rows = (int(np.ceil((extent - side) / (0.7 * side))) + 1 for extent in (width, height))
        for y in np.linspace(side / 2, height - side / 2, rows) if rows > 1 else [height / 2]:
            for x in np.linspace(side / 2, width - side / 2, columns) if columns > 1 else [width / 2]:
                found.append(Region(float(x), float(y), side))
    return found


@lru_cache(maxsize=1)
def _hog() -> cv2.HOGDescriptor:
    hog = cv2.HOGDescriptor()
    hog.setSVMDetector(cv2.HOGDescriptor_getDefaultPeopleDetector())  # type: ignore[attr-defined]
    return hog


def _upright_boxes(image: UInt8[np.ndarray, "height width 3"]) -> list[Region]:
    """Regions of standing people by histograms of gradients, best first."""
    scale = min(1.0, 640 / max(image.shape[:2]))
    small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    if small.shape[0] < 128 or small.shape[1] < 64:
        return []
    boxes, weights = _hog().detectMultiScale(small, winStride=(8, 8), padding=(8, 8), scale=1.08)
    order = np.argsort(-np.ravel(weights), kind="stable")
    identity = np.array([[1 / scale, 0, 0], [0, 1 / scale, 0]])
    regions = []
    for x, y, w, h in np.reshape(boxes, (-1, 4))[order][:8]:
        centre = transform(identity, np.array([x + w / 2, y + h / 2]))
        regions.append(Region(float(centre[0]), float(centre[1]), float(h) / scale))
    return regions
