"""Colours of clothes, hair and skin: they distinguish people whom pose and position do not."""

import cv2
import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.perception.observation import Observation
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import invert, transform
from humanmm.models.records import landmarks
from humanmm.models.records.landmarks import INDEX
from humanmm.models.records.tracks import MASK_SIDE

HUES, SATURATIONS, GREYS = 12, 3, 4
_PART = HUES * SATURATIONS + GREYS
HISTOGRAM_BINS = 2 * _PART
"""Colours of the upper and of the lower body: hue × saturation, or brightness where there is no colour."""

_FAINT, _DARK = 40, 40
"""Below this saturation or brightness (of 255) a hue means nothing."""
_SIDE = 64

PARTS = ("hair", "chest", "belly", "upper arms", "forearms", "thighs", "shanks", "feet")
GROUND = len(PARTS)
"""Row of the ground that somebody stands on, after the rows of his parts."""
_LIMBS = (
    ("upper arms", "shoulder", "elbow", 0.25, 0.022), ("forearms", "elbow", "wrist", 0.0, 0.018),
    ("thighs", "hip", "knee", 0.3, 0.03), ("shanks", "knee", "ankle", 0.0, 0.022),
    ("feet", "heel", "foot_index", 0.0, 0.015),
)  # fmt: skip
"""Part, its ends, the fraction left out at its first end, where it is hidden in the trunk, and half its width as a
fraction of the standing height."""
_TRUNK_WIDTH, _HAIR_WIDTH = 0.05, 0.03
_HAIR = (0.045, 0.08)
"""Hair lies so far above the ears, fractions of the standing height."""
_STATURE_M = 1.7
_SEEN = 0.5
_BESIDE_FEET, _CLEAR_OF_BODY = 0.2, 9
"""The ground is what lies beside the lowest fifth of the mask and below it, some mask pixels away."""
_FEWEST_PIXELS = 12


def clothing_histogram(image: Picture, seen: Observation) -> Float[np.ndarray, " bins"]:
    """Colours on the mask above and below the hips, each half summing to 0.5 (0 where nothing of it is seen)."""
    picture = cv2.cvtColor(image.as_filmed.crop(seen.region, _SIDE), cv2.COLOR_RGB2HSV).astype(np.int64)
    mask = cv2.resize(cv2.erode(seen.mask, np.ones((3, 3), np.uint8)), (_SIDE, _SIDE), interpolation=cv2.INTER_NEAREST)
    torso = transform(invert(seen.region.to_source(_SIDE)), seen.keypoints[list(landmarks.TORSO), :2])
    shoulders, hips = torso[:2].mean(axis=0), torso[2:].mean(axis=0)
    axis = hips - shoulders
    y, x = np.mgrid[0:_SIDE, 0:_SIDE] + 0.5
    along = ((x - shoulders[0]) * axis[0] + (y - shoulders[1]) * axis[1]) / max(float(axis @ axis), 1e-6)
    hue, saturation, brightness = picture[..., 0], picture[..., 1], picture[..., 2]
    colour = (hue * HUES // 180) * SATURATIONS + np.clip((saturation - _FAINT) * SATURATIONS // 216, 0, SATURATIONS - 1)
    grey = HUES * SATURATIONS + brightness * GREYS // 256
    label = np.where((saturation < _FAINT) | (brightness < _DARK), grey, colour)
    halves = []
    for part in ((along > 0) & (along <= 1), (along > 1) & (along <= 3)):
        counts = np.bincount(label[(mask > 0) & part], minlength=_PART).astype(np.float64)
        halves.append(0.5 * counts / max(float(counts.sum()), 1.0))
    return np.concatenate(halves)


def part_colours(image: Picture, seen: Observation) -> Float[np.ndarray, "9 3"]:
    """Median colour (CIE L*a*b*, L 0..100) of each of PARTS on the mask, then of the ground about the feet.

    NaN where too little of a part is seen, and for the ground if the feet are not in the picture.
    """
    crop = image.as_filmed.crop(seen.region, MASK_SIDE)
    mask = cv2.erode(seen.mask, np.ones((3, 3), np.uint8)) > 0
    points = transform(invert(seen.mask_to_source), seen.keypoints[:, :2])
    where = _parts_of_crop(points, seen.keypoints[:, 2], _standing_px(points, seen.landmarks3d))
    where = [*(part & mask for part in where), _ground_of_crop(image, seen, points)]
    colours = np.full((len(where), 3), np.nan)
    for row, part in enumerate(where):
        pixels = crop[part]
        if len(pixels) >= _FEWEST_PIXELS:
            lab = cv2.cvtColor(pixels[None].astype(np.float32) / 255, cv2.COLOR_RGB2Lab)
            colours[row] = np.median(lab[0], axis=0)
    return colours


def _ground_of_crop(
    image: Picture, seen: Observation, points: Float[np.ndarray, "33 2"]
) -> Bool[np.ndarray, "mask mask"]:
    """Which pixels of the crop show the ground that somebody stands on."""
    ankles = [INDEX["left_ankle"], INDEX["right_ankle"]]
    rows = np.flatnonzero(seen.mask.any(axis=1))
    y, x = np.mgrid[0:MASK_SIDE, 0:MASK_SIDE] + 0.5
    if seen.keypoints[ankles, 2].min() < _SEEN or not len(rows) or points[ankles, 1].max() > MASK_SIDE:
        return np.zeros((MASK_SIDE, MASK_SIDE), bool)
    in_source = transform(seen.mask_to_source, np.stack([x, y], axis=-1))
    in_picture = ((in_source > 0) & (in_source < np.array(image.size))).all(axis=-1)
    body = cv2.dilate(seen.mask, np.ones((_CLEAR_OF_BODY, _CLEAR_OF_BODY), np.uint8)) > 0
    return np.asarray(in_picture & ~body & (y > rows[-1] - _BESIDE_FEET * (rows[-1] - rows[0])))


def _standing_px(points: Float[np.ndarray, "33 2"], landmarks3d: Float[np.ndarray, "33 3"]) -> float:
    """Height of a standing person of average stature, in pixels of the points."""
    extent = [np.linalg.norm(flat - flat.mean(axis=0), axis=1).sum() for flat in (points, landmarks3d[:, :2])]
    return float(_STATURE_M * extent[0] / max(extent[1], 1e-6))


def _parts_of_crop(
    points: Float[np.ndarray, "33 2"], visibility: Float[np.ndarray, " 33"], height: float
) -> list[Bool[np.ndarray, "mask mask"]]:
    """Which pixels of the crop lie on each of PARTS: near the line between its ends. Arms lie before the trunk."""
    found = {part: np.zeros((MASK_SIDE, MASK_SIDE), np.uint8) for part in PARTS}

    def draw(part: str, a: np.ndarray, b: np.ndarray, width: float) -> None:
        first, last = ((16 * (np.clip(end, -MASK_SIDE, 2 * MASK_SIDE) - 0.5)).astype(int).tolist() for end in (a, b))
        cv2.line(found[part], first, last, 1, max(3, round(2 * width * height)), shift=4)

    for part, first, last, hidden, width in _LIMBS:
        for side in ("left", "right"):
            ends = INDEX[f"{side}_{first}"], INDEX[f"{side}_{last}"]
            if min(visibility[list(ends)]) > _SEEN:
                a, b = points[list(ends)]
                draw(part, a + hidden * (b - a), b, width)
    shoulders, hips = (points[list(pair)].mean(axis=0) for pair in (landmarks.SHOULDERS, landmarks.HIPS))
    ears = points[[INDEX["left_ear"], INDEX["right_ear"]]].mean(axis=0)
    up = (ears - shoulders) / max(float(np.linalg.norm(ears - shoulders)), 1e-6)
    low, high = (ears + up * distance * height for distance in _HAIR)
    draw("hair", low, high, _HAIR_WIDTH)
    trunk = hips - shoulders
    for part, top, bottom in (("chest", 0.15, 0.5), ("belly", 0.5, 0.9)):
        draw(part, shoulders + top * trunk, shoulders + bottom * trunk, _TRUNK_WIDTH)
        found[part][(found["upper arms"] | found["forearms"]) > 0] = 0
    return [pixels > 0 for pixels in found.values()]


def mean_colours(samples: Float[np.ndarray, "samples bins"]) -> Float[np.ndarray, " bins"]:
    """One histogram of many, summing to 1 (0 when nothing was seen)."""
    total = np.asarray(samples, np.float64).sum(axis=0)
    return np.asarray(total / max(float(total.sum()), 1e-9))


def colour_distance(a: Float[np.ndarray, " bins"], b: Float[np.ndarray, " bins"]) -> float:
    """Hellinger distance of two histograms that sum to 1: 0 equal, 1 nothing in common."""
    return float(np.sqrt(max(0.0, 1 - float(np.sqrt(a * b).sum()))))
