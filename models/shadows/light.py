"""How likely each direction of the light is, from what is dark on the floor around a person.

For every direction the limbs are projected onto the floor along the light. A shadow makes the floor darker by one
factor; what is left is the floor's own pattern, which is the same in all pictures as far as the person stands still,
and noise. The gain of the best factor over none, in log likelihood, is the evidence.
"""

import math

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from humanmm.models.body.body24 import JOINT_NAMES, PARENTS
from humanmm.models.geometry.robust import STD_PER_MEDIAN
from humanmm.models.shadows.floor import CELL_M, REACH_M, SIDE, PosedOnFloor, SeenFloor

Array = np.ndarray

STEP_DEG = 15.0
AZIMUTHS_DEG = np.arange(0.0, 360.0, STEP_DEG)
"""Where the light comes from, about the vertical, from the x axis to the y axis."""
ELEVATIONS_DEG = np.array([25.0, 34.0, 43.0, 52.0, 61.0, 70.0, 79.0, 90.0])
"""Lower, a shadow is longer than what is looked at; the last is a lamp overhead, which tells no azimuth."""
TRUNK_M, LIMB_M = 0.12, 0.07
"""Radii of what casts the shadow about the bones of the trunk and of the limbs."""
LIMBS = np.array([(parent, joint) for joint, parent in enumerate(PARENTS) if parent >= 0])
TRUNK = np.array(
    [bone for bone in LIMBS if JOINT_NAMES[bone[1]] in ("Spine1", "Spine2", "Spine3", "Neck", "L_Collar", "R_Collar")]
)
_WIDE_TRUNK, _WIDE_LIMB = (max(1, round(2 * radius / CELL_M)) for radius in (TRUNK_M, LIMB_M))
EVIDENCE = 1 / 12
"""Log likelihood of a unit of gain: cells beside one another, and pictures one after the other, are no independent
witnesses. Chosen with the error of a shadow (docs/measurements/cuts.md, "Shadows")."""
DARKEST_SHADOW = 1.2
"""Largest log ratio of brightness that a shadow has."""
NOISE, PATTERN = 0.01, 0.05
"""Least standard deviations of the noise and of the floor's pattern, log brightness."""
LARGEST_SIGMAS, LEAST_SPREAD = 3.0, 0.15
"""Brightness further than so many robust standard deviations (of no less than LEAST_SPREAD) from the median counts as
this far: white lines, drains."""


def light_log_likelihood(person: PosedOnFloor, floor: SeenFloor) -> Float[Array, "azimuths elevations"]:
    """Against no shadow at all, of AZIMUTHS_DEG × ELEVATIONS_DEG; 0 where nothing is seen."""
    seen = floor.seen.reshape(len(floor.seen), -1)
    count = seen.sum(axis=0)
    if not count.any():
        return np.zeros((len(AZIMUTHS_DEG), len(ELEVATIONS_DEG)))
    value = _clipped(floor).reshape(seen.shape)
    times = np.maximum(count, 1)
    mean = value.sum(axis=0) / times
    beside = np.where(seen, value - mean, 0.0)
    used = count > 0
    noise = max(float((beside**2).sum()) / max(int((count[used] - 1).sum()), 1), NOISE**2)
    pattern = max(float(mean[used].var()) - noise * float((1 / count[used]).mean()), PATTERN**2)
    weight = np.where(used, 1 / (pattern + noise / times), 0.0)
    # Both parts of the likelihood, of the cells' means and of what differs between pictures, are linear in the masks.
    of_mean = weight * (mean - float(weight @ mean) / weight.sum())
    slope = np.where(seen, of_mean / times + beside / noise, 0.0).ravel().astype(np.float32)
    found = np.empty((len(AZIMUTHS_DEG), len(ELEVATIONS_DEG)))
    *slanting, overhead = np.radians(ELEVATIONS_DEG)
    below = cast_shadows(person, 0.0, overhead)  # the same for all azimuths
    for row, azimuth in enumerate(np.radians(AZIMUTHS_DEG)):
        masks = np.stack([*(cast_shadows(person, azimuth, elevation) for elevation in slanting), below])
        covered = masks.reshape(len(masks), *seen.shape) & seen
        darker = -(covered.reshape(len(masks), -1).astype(np.float32) @ slope)
        num = covered.sum(axis=1, dtype=np.uint8)
        fraction = num / times
        information = (
            (fraction**2) @ (weight - count / noise) - (fraction @ weight) ** 2 / weight.sum() + num.sum(axis=1) / noise
        )
        factor = np.clip(darker / np.maximum(information, 1e-9), 0.0, DARKEST_SHADOW)
        found[row] = factor * darker - 0.5 * factor**2 * information
    return np.asarray(EVIDENCE * found)


def cast_shadows(person: PosedOnFloor, azimuth: float, elevation: float) -> UInt8[Array, "F side side"]:
    """Where the shadow of a person falls in each picture's cells, 0 or 1; the direction of the light in radians."""
    away = -np.array([math.cos(azimuth), math.sin(azimuth)]) / math.tan(elevation)
    on_floor = person.joints[..., :2] + person.height[..., None] * away
    cells = ((on_floor + REACH_M) / CELL_M).clip(-9999, 9999).astype(np.int32)
    masks = np.zeros((len(cells), SIDE, SIDE), np.uint8)
    bones = (np.ascontiguousarray(cells[:, which]) for which in (TRUNK, LIMBS))
    for mask, trunk, limbs in zip(masks, *bones, strict=True):
        cv2.polylines(mask, list(trunk), False, 1, _WIDE_TRUNK)
        cv2.polylines(mask, list(limbs), False, 1, _WIDE_LIMB)
    return masks


def _clipped(floor: SeenFloor) -> Float[Array, "F side side"]:
    spread = STD_PER_MEDIAN * float(np.median(np.abs(floor.log_brightness[floor.seen])))
    limit = LARGEST_SIGMAS * max(spread, LEAST_SPREAD)
    return np.asarray(np.clip(floor.log_brightness, -limit, limit))
