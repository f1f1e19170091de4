"""Finding everybody in one frame: the detector, the detector again with the found painted out, tiles, and HOG boxes."""

from functools import lru_cache

import cv2
import numpy as np
from jaxtyping import UInt8

from humanmm.models.perception.interfaces import Networks, PoseNetwork
from humanmm.models.perception.observation import Observation, observe, similarity
from humanmm.models.perception.picture import Picture, whole
from humanmm.models.perception.regions import Region, transform, warp

SETTLE_ROUNDS = 3
DUPLICATE_SIMILARITY = 0.5
MAX_COVERED = 0.4
"""A painted-out silhouette still looks like a person: whoever lies largely on paint is nobody new."""
_PAINT = 127


def find_people(
    networks: Networks,
    image: Picture,
    known: list[Observation],
    places: list[Region],
    *,
    upright: bool,
    limit: int,
) -> list[Observation]:
    """People in the frame who are not among the known, at most `limit` of them.

    The detector mostly returns one person a picture and misses people below a quarter of its height: it looks at each
    of the `places` again with the found painted out; `upright` adds a search for standing people by another method.
    """
    search = _Search(networks, image, known)
    for within in places:
        while len(search.found) < limit:
            regions = [detection.region for detection in networks.detect(search.canvas, within)]
            if not any([search.take(region) for region in regions[: limit - len(search.found)]]):
                break
    if upright:
        for region in _upright_boxes(search.canvas):
            if len(search.found) < limit:
                search.take(region)
    return search.found


class _Search:
    """One frame's search: who was found, and the frame with everybody found painted out."""

    def __init__(self, networks: Networks, image: Picture, known: list[Observation]) -> None:
        self._networks = networks
        self._known = known
        self._image = image
        self.found: list[Observation] = []
        self.canvas = image.copy()
        self._painted = np.zeros((image.height, image.width), np.uint8)
        for person in known:
            paint_out(self.canvas, person, self._painted)

    def take(self, region: Region) -> bool:
        """Look at a region; True when it holds somebody new, who is then painted out."""
        person = settle(self._networks.locate, self.canvas, region)
        if person is None or any(same_person(person, other) for other in [*self._known, *self.found]):
            return False
        if self.found or self._known:
            # A body put together from what the paint left over falls apart when it is looked at without the paint.
            bare = observe(self._networks.locate(self._image, person.region), self._image.size)
            if bare is None or any(same_person(bare, other) for other in [*self._known, *self.found]):
                return False
            if max(covered_fraction(self._painted, person), covered_fraction(self._painted, bare)) > MAX_COVERED:
                return False
        self.found.append(person)
        paint_out(self.canvas, person, self._painted)
        return True


def covered_fraction(painted: UInt8[np.ndarray, "height width"], person: Observation) -> float:
    """Fraction of the person's mask that lies on paint."""
    size = (person.mask.shape[1], person.mask.shape[0])
    paint = warp(painted, person.mask_to_source, size, nearest=True)
    return float((paint * person.mask).sum() / max(int(person.mask.sum()), 1))


def settle(locate: PoseNetwork, image: Picture, region: Region) -> Observation | None:
    """The person in a region, looked at until the crop follows from its own output."""
    seen = None
    for _ in range(SETTLE_ROUNDS):
        output = locate(image, region)
        seen = observe(output, image.size)
        if seen is None:
            return None
        region = output.next_region
    return seen


def same_person(a: Observation, b: Observation) -> bool:
    """True where two observations of one frame show one body."""
    return similarity(a.keypoints, b.keypoints, min(a.region.side, b.region.side)) > DUPLICATE_SIMILARITY


def paint_out(
    canvas: Picture,
    person: Observation,
    painted: UInt8[np.ndarray, "height width"] | None = None,
) -> None:
    """Cover the person's mask with grey, in place, so that the networks see who else is there; note 1 in `painted`."""
    region, size = person.region, person.mask.shape[0]
    grown = cv2.dilate(person.mask, np.ones((5, 5), np.uint8))
    low = np.floor([region.x - 0.75 * region.side, region.y - 0.75 * region.side]).astype(int)
    high = np.ceil([region.x + 0.75 * region.side, region.y + 0.75 * region.side]).astype(int)
    low, high = np.maximum(low - low % 2, 0), np.minimum(high + high % 2, canvas.size)
    if (high - low).min() <= 0:
        return
    matrix = region.to_source(size)
    matrix[:, 2] += matrix[:, :2] @ np.array([0.5, 0.5]) - 0.5 - low
    covered = cv2.warpAffine(grown, matrix, (int(high[0] - low[0]), int(high[1] - low[1])), flags=cv2.INTER_NEAREST)
    canvas.paint(int(low[0]), int(low[1]), covered, _PAINT)
    if painted is not None:
        marked = painted[low[1] : high[1], low[0] : high[0]]
        np.maximum(marked, covered, out=marked)


def places_to_look(image: Picture, turn: int, *, thorough: bool) -> list[Region]:
    """Where to look in one search: everywhere, or alternately the whole frame and a large tile, and one small tile."""
    large, small = tiles(image)
    if thorough:
        return [whole(image), *large, *small]
    wide = [whole(image)] if turn % 2 or not large else [large[turn // 2 % len(large)]]
    return [*wide, *([small[turn % len(small)]] if small else [])]


def tiles(image: Picture) -> tuple[list[Region], list[Region]]:
    """Overlapping squares that enlarge parts of the frame: large ones of the frame's shorter side, and of its half."""
    width, height = image.size
    short = min(height, width)
    both: tuple[list[Region], list[Region]] = ([], [])
    for side, found in zip((float(short), short / 2), both, strict=True):
        if side < 96:
            continue
        columns, rows = (int(np.ceil((extent - side) / (0.7 * side))) + 1 for extent in (width, height))
        for y in np.linspace(side / 2, height - side / 2, rows) if rows > 1 else [height / 2]:
            for x in np.linspace(side / 2, width - side / 2, columns) if columns > 1 else [width / 2]:
                found.append(Region(float(x), float(y), side))
    return both


@lru_cache(maxsize=1)
def _hog() -> cv2.HOGDescriptor:
    hog = cv2.HOGDescriptor()
    hog.setSVMDetector(cv2.HOGDescriptor_getDefaultPeopleDetector())  # type: ignore[attr-defined]
    return hog


def _upright_boxes(image: Picture) -> list[Region]:
    """Regions of standing people by histograms of gradients, best first."""
    scale = min(1.0, 640 / max(image.size))
    small = image.reduced(scale)
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
