"""Finding everybody in one frame: the detector, and the detector again with the found painted out."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from humanmm.models.perception.interfaces import SEEN, Detection, Networks, PersonDetector, PoseNetwork
from humanmm.models.perception.observation import Observation, observe, similarity
from humanmm.models.perception.picture import Picture, whole
from humanmm.models.perception.regions import HEIGHT_OF_SIDE, Region
from humanmm.models.perception.tracking.painting import covered_fraction, detected_keypoints, paint_out, without
from humanmm.models.records import landmarks

SETTLE_ROUNDS = 3
DUPLICATE_SIMILARITY = 0.5
OTHER_BODY = 0.08
"""Median distance of the keypoints, as a fraction of the height, from which a pose is not that of the person
detected."""
OTHER_SHOULDERS = 0.05
"""Distance of the middles of the shoulders, as a fraction of the height, below which two detections are one body."""
FEWEST_POINTS = 5
"""Of the keypoints that the detector sees, for their distances to say so."""
CLOSE_UP = 2.0
"""How much larger than the detector's guess the region is of somebody whose hips it does not see."""
FARTHER, LARGE = 1.7, 0.65
"""How much smaller the frame is shown a second time for people larger than LARGE of its longer side."""
WIDE = 1.3
"""Width over height (or the other way) of a frame whose parts are as high as it is."""
SAME_REGION_SHIFT, SAME_REGION_RATIO = 0.25, 1.6
MAX_COVERED = 0.4
"""A painted-out silhouette still looks like a person: whoever lies largely on paint is nobody new."""


def detections(detect: PersonDetector, image: Picture) -> list[Detection]:
    """People in the whole frame, best first; who nearly fills it as the detector sees him from farther away.

    Detectors see people well up to two thirds of a picture; somebody larger is missed, or scores little.
    """
    frame = whole(image)
    near = detect(image, frame)
    large = [
        one
        for one in detect(image, frame.scaled(FARTHER))
        if (one.box[2:] - one.box[:2]).max() >= LARGE * frame.side
        and all(other.score < one.score for other in near if other.has_box(one.box))
    ]
    others = [one for one in near if not any(one.has_box(other.box) for other in large)]
    return sorted([*large, *others], key=lambda one: -one.score)


def find_people(
    networks: Networks,
    image: Picture,
    known: list[Observation],
    detections: Sequence[Detection],
    *,
    behind: bool,
    closer: bool,
    limit: int,
) -> list[Observation]:
    """People in the frame who are not among the known, at most `limit` of them.

    `detections` are of the whole frame. `behind` looks at it again with everybody known and found painted out: somebody
    nearly hidden shows then. `closer` looks at enlarged parts of the frame: somebody small shows then.
    """
    search = _Search(networks, image, known)
    seen = detections
    places = [*([whole(image)] if behind else []), *(tiles(image) if closer else [])]
    while True:
        for detection in seen:
            if len(search.found) < limit:
                search.take(detection, among_all=seen is detections)
        if not places or len(search.found) >= limit:
            return search.found
        seen = networks.detect(search.canvas, places.pop(0))


class _Search:
    """One frame's search: who was found, and the frame with everybody found painted out."""

    def __init__(self, networks: Networks, image: Picture, known: list[Observation]) -> None:
        self._networks = networks
        self._known = known
        self._image = image
        self.found: list[Observation] = []
        self.canvas, self._painted = without(image, known)

    def take(self, detection: Detection, *, among_all: bool) -> None:
        """Look at a detection; if it is somebody new, note and paint him out.

        `among_all`: the detector saw him beside everybody else. Else he was found where these are painted out.
        """
        others = [*self._known, *self.found]
        joints = detected_keypoints(detection) if among_all else None
        if any(lies_on(other, detection) for other in others):
            return
        if joints is not None and any(same_shoulders(other, joints) for other in others):
            return
        canvas, painted = self.canvas, self._painted
        if others and joints is not None:
            canvas, painted = without(self._image, others, spared=joints)
        person = settle(self._networks.locate, canvas, detection)
        if person is None or any(same_person(person, other) for other in others):
            return
        if others and joints is None:
            # A body put together from what the paint left over falls apart when it is looked at without the paint.
            bare = observe(self._networks.locate(self._image, person.region), self._image.size)
            if bare is None or any(same_person(bare, other) for other in others):
                return
            if covered_fraction(painted, bare) > MAX_COVERED:
                return
        if others and covered_fraction(painted, person) > MAX_COVERED:
            return
        self.found.append(person)
        paint_out(self.canvas, person, self._painted)


def settle(locate: PoseNetwork, image: Picture, detection: Detection) -> Observation | None:
    """The detected person, looked at in his region, and if he is not seen there as that of a close-up."""
    seen = _settled(locate, image, detection, detection.region)
    if seen is None and _is_close_up(detection):
        return _settled(locate, image, detection, detection.region.scaled(CLOSE_UP))
    return seen


def _settled(locate: PoseNetwork, image: Picture, detection: Detection, region: Region) -> Observation | None:
    """The detected person, looked at until the crop follows from its own output, but not beyond where it slides away
    to somebody else than the detector saw. Of a close-up the detector guesses the region: the pose may lie on him only
    when its own crop is looked at."""
    seen = None
    for _ in range(SETTLE_ROUNDS):
        output = locate(image, region)
        now = observe(output, image.size)
        if now is None:
            return None
        if lies_on(now, detection):
            seen = now
        elif seen is not None:
            break
        region = output.next_region
    return seen


def _is_close_up(detection: Detection) -> bool:
    """True where the detector sees shoulders and no hips, and guesses these into the picture."""
    if detection.keypoints is None:
        return False
    score = detection.keypoints[:, 2]
    return bool(score[list(landmarks.COCO_SHOULDERS)].min() > SEEN > score[list(landmarks.COCO_HIPS)].max())


def lies_on(seen: Observation, detection: Detection) -> bool:
    """True where a pose is that of the person detected, as far as the keypoints say that the detector sees (or else its
    region). Either may have exchanged left and right."""
    points = detection.keypoints
    if points is not None and np.count_nonzero(points[:, 2] > SEEN) >= FEWEST_POINTS:
        apart = min(_apart(seen, points), _apart(seen, points[landmarks.COCO_SWAP]))
        return apart < OTHER_BODY * HEIGHT_OF_SIDE * seen.region.side
    return not seen.next_region.outlier_of(detection.region, shift=SAME_REGION_SHIFT, ratio=SAME_REGION_RATIO)


def _apart(seen: Observation, points: Float[np.ndarray, "17 3"]) -> float:
    """Median distance of a pose from the keypoints that a detector sees, pixels."""
    distance = np.linalg.norm(seen.keypoints[list(landmarks.COCO_LANDMARKS), :2] - points[:, :2], axis=1)
    return float(np.median(distance[points[:, 2] > SEEN]))


def same_shoulders(seen: Observation, joints: Float[np.ndarray, "33 3"]) -> bool:
    """True where somebody whose joints a detector sees has another's shoulders: one body, seen twice.

    Two people in contact have theirs 7 % of the height apart and more (16 rendered pairs).
    """
    both = list(landmarks.SHOULDERS)
    apart = joints[both, :2].mean(axis=0) - seen.keypoints[both, :2].mean(axis=0)
    return bool(np.linalg.norm(apart) < OTHER_SHOULDERS * HEIGHT_OF_SIDE * seen.region.side)


def same_person(a: Observation, b: Observation) -> bool:
    """True where two observations of one frame show one body."""
    return similarity(a.keypoints, b.keypoints, min(a.region.side, b.region.side)) > DUPLICATE_SIMILARITY


def tiles(image: Picture) -> list[Region]:
    """Overlapping squares of the frame's shorter side (its half where the frame is no wider), side by side."""
    width, height = image.size
    side = float(min(height, width)) * (1.0 if max(image.size) >= WIDE * min(image.size) else 0.6)
    columns, rows = (int(np.ceil((extent - side) / (0.7 * side))) + 1 for extent in (width, height))
    return [
        Region(float(x), float(y), side)
        for y in np.linspace(side / 2, height - side / 2, rows)
        for x in np.linspace(side / 2, width - side / 2, columns)
    ]
