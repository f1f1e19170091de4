"""Two people who touch or cover one another: each is looked at again with the other's part of the picture painted out.

The pose networks see one person in a crop, and with two in it lend a limb of one to the other. MultiPose places the
keypoints of all people jointly; its bones divide the picture between the two (a Voronoi diagram, by the distance
transform), and nobody's network sees the part of the other.
"""

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from humanmm.models.geometry.boxes import box_iou
from humanmm.models.perception.interfaces import Detection, Networks
from humanmm.models.perception.observation import Observation, observe, similarity
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import HEIGHT_OF_SIDE, Region
from humanmm.models.records import landmarks

Array = np.ndarray
Points = Float[Array, "12 3"]

TOUCHING = 0.1
"""Overlap (IoU) of two boxes from which a limb of one may be taken for the other's."""
AROUND = 1.25
"""Side of what MultiPose looks at over that of both boxes."""
SAME_BODY = 0.15
"""Median distance of the limbs, in heights, up to which a detection is of an observed person."""
CREDIBLE = 0.2
"""Score of a keypoint whose bones count."""
REACH = 0.09
"""How far from a bone, in heights, a body reaches."""
SAME_POSE = 0.5
"""Similarity that the second look must have with the first."""
WORKING_HEIGHT_PX = 200
"""Of a person in the picture that is divided."""
PAINT = 127
BONES = ((0, 1), (0, 2), (2, 4), (1, 3), (3, 5), (0, 6), (1, 7), (6, 7), (6, 8), (8, 10), (7, 9), (9, 11))
"""Between `landmarks.LIMBS`."""


def touching(a: Observation, b: Observation) -> bool:
    """Whether a limb of one may be taken for the other's."""
    return bool(box_iou(a.bbox, b.bbox[None])[0] > TOUCHING)


def looked_at_apart(
    networks: Networks, image: Picture, a: Observation, b: Observation
) -> tuple[Observation, Observation] | None:
    """Both people of one frame, each seen without the other; None if MultiPose does not see two people there.

    Who looks unlike himself without the other stays as he was.
    """
    bones = _bones(networks, image, a, b)
    if bones is None:
        return None
    scale = min(1.0, WORKING_HEIGHT_PX / max(_height(a), _height(b)))
    of_a, of_b = (_distance(points, image.size, scale) for points in bones)
    return _without(networks, image, a, of_a, of_b), _without(networks, image, b, of_b, of_a)


def _without(
    networks: Networks, image: Picture, person: Observation, own: Float[Array, "h w"], other: Float[Array, "h w"]
) -> Observation:
    """Another look at a person, with what is nearer to the other's bones painted out."""
    theirs = ((other < own) & (other < REACH * _height(person))).astype(np.uint8)
    even = image.width // 2 * 2, image.height // 2 * 2
    canvas = image.copy()
    canvas.paint(0, 0, np.asarray(cv2.resize(theirs, even, interpolation=cv2.INTER_NEAREST), np.uint8), PAINT)
    again = observe(networks.locate(canvas, person.region), image.size)
    if again is None or similarity(again.keypoints, person.keypoints, person.region.side) < SAME_POSE:
        return person
    return again


def _height(person: Observation) -> float:
    return HEIGHT_OF_SIDE * person.region.side


def _bones(networks: Networks, image: Picture, a: Observation, b: Observation) -> tuple[Points, Points] | None:
    """MultiPose's limbs of both."""
    low, high = np.minimum(a.bbox[:2], b.bbox[:2]), np.maximum(a.bbox[2:], b.bbox[2:])
    middle = (low + high) / 2
    found = networks.detect(image, Region(float(middle[0]), float(middle[1]), AROUND * float((high - low).max())))
    limbs = [_limbs(one) for one in found if one.keypoints is not None]
    apart = np.array([[_apart(person, points) for points in limbs] for person in (a, b)]).reshape(2, -1)
    pairs = [(i, j) for i in range(len(limbs)) for j in range(len(limbs)) if i != j]
    if not pairs:
        return None
    i, j = min(pairs, key=lambda pair: apart[0, pair[0]] + apart[1, pair[1]])
    return (limbs[i], limbs[j]) if max(apart[0, i], apart[1, j]) <= SAME_BODY else None


def _limbs(detection: Detection) -> Points:
    assert detection.keypoints is not None
    return np.asarray(detection.keypoints[list(landmarks.COCO_LIMBS)])


def _apart(person: Observation, limbs: Points) -> float:
    seen = person.keypoints[list(landmarks.LIMBS), :2]
    return float(np.median(np.linalg.norm(seen - limbs[:, :2], axis=1))) / _height(person)


def _distance(limbs: Points, size: tuple[int, int], scale: float) -> Float[Array, "h w"]:
    """Pixels of the picture to the nearest bone, at every pixel of the picture reduced by `scale`."""
    empty: UInt8[Array, "h w"] = np.full((int(size[1] * scale) + 1, int(size[0] * scale) + 1), 255, np.uint8)
    ends = [(int(x), int(y)) for x, y in np.nan_to_num(limbs[:, :2] * scale)]
    for start, end in BONES:
        if min(limbs[start, 2], limbs[end, 2]) > CREDIBLE:
            cv2.line(empty, ends[start], ends[end], 0, 1)
    return np.asarray(cv2.distanceTransform(empty, cv2.DIST_L2, 3)) / scale
