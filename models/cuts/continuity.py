"""Whether people go on across a cut as they did before it. Where an editor left time out, or where one side's pose is
wrong, limbs are not where they were going; how far somebody went meanwhile no picture says."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from humanmm.models.body.body24 import JOINT_NAMES, load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.geometry.lines import line_through
from humanmm.models.records.motion import PersonShotMotion, PoseJump
from humanmm.models.video.frame_times import ROUNDING_S

Array = np.ndarray

LIMBS = tuple(
    JOINT_NAMES.index(name)
    for name in ("L_Knee", "R_Knee", "L_Ankle", "R_Ankle", "Head", "L_Elbow", "R_Elbow", "L_Wrist", "R_Wrist")
)
SPAN_S, LONGEST_SPAN_S = 0.1, 0.25
"""Span over which the velocity of limbs is measured on each side: in slow videos as long as it takes for FEWEST_FRAMES,
up to the longest."""
LONGEST_GAP_S = 0.2
"""Over a longer time without an observation limbs may be anywhere."""
FEWEST_FRAMES = 3
USUAL_M = 0.06
"""Expected error of a pose of which nothing foretells any."""
TOO_FAR = 3.4
"""Limbs that are so many times as far from where they were going as poses are expected to be off did not go there
(docs/measurements/cuts.md)."""


def goes_on(jump_m: float, expected_m: float) -> bool:
    """Whether a motion with such a `PoseJump` may be one motion."""
    return jump_m <= TOO_FAR * expected_m


@dataclass(frozen=True)
class _Side:
    """The end of a shot that faces the cut: limbs about the pelvis, in the axes of the pelvis, metres."""

    time_s: float
    limbs: Float[Array, "9 3"]
    velocity: Float[Array, "9 3"]
    error_m: float
    """How far the pose is expected to be off."""


def pose_jumps(
    before: Mapping[int, PersonShotMotion], after: Mapping[int, PersonShotMotion], time_s: Float[Array, " F"]
) -> tuple[PoseJump, ...]:
    """Of those who are seen right before and right after a cut; by person, their motions in the two shots."""
    jumps = []
    for person in sorted(before.keys() & after.keys()):
        ending, beginning = _side(before[person], time_s, last=True), _side(after[person], time_s, last=False)
        if ending is None or beginning is None or beginning.time_s - ending.time_s > LONGEST_GAP_S:
            continue
        velocity = 0.5 * (ending.velocity + beginning.velocity)
        off = beginning.limbs - ending.limbs - (beginning.time_s - ending.time_s) * velocity
        jump_m = float(np.sqrt(np.mean(np.sum(off**2, axis=-1))))
        jumps.append(PoseJump(person, jump_m, math.hypot(ending.error_m, beginning.error_m)))
    return tuple(jumps)


def _side(motion: PersonShotMotion, time_s: Float[Array, " F"], *, last: bool) -> _Side | None:
    """None where hardly anything was seen."""
    rows = np.flatnonzero(motion.observed)
    if not len(rows):
        return None
    seconds = time_s[motion.frame[rows]]
    end = seconds[-1] if last else seconds[0]
    fewest_s = (FEWEST_FRAMES - 1) * float(np.median(np.diff(time_s)))
    near = np.abs(seconds - end) <= min(max(SPAN_S, fewest_s), LONGEST_SPAN_S) + ROUNDING_S
    rows, since = rows[near], seconds[near] - end
    if len(rows) < FEWEST_FRAMES:
        return None
    upright, nowhere = np.tile(np.eye(3), (len(rows), 1, 1)), np.zeros((len(rows), 3))
    rest = load_body().rest_joints(motion.betas)
    limbs = forward_kinematics(rest, upright, motion.body_pose[rows], nowhere)[0][:, LIMBS]
    at_end, velocity = line_through(since, limbs)
    errors = motion.pose_error_m[rows]
    error_m = float(errors[np.isfinite(errors)].mean()) if np.isfinite(errors).any() else USUAL_M
    return _Side(float(end), at_end, velocity, error_m)
