"""Planted feet do not move: one anchor per contact, approached and left without a pop (Kovar et al. 2002, "Footskate
cleanup for motion capture editing").

A contact holds the ankle, the toe base or both. Each joint gets the anchor that its own path suggests; the ankle's
displacement to it is a correction that is exact inside the contact and fades out on both sides. A planted toe base with
a lifting heel holds the foot through the ankle: the foot rotates about its ball. Hip and knee then follow by two-bone
inverse kinematics about the knee's own axis, and the foot keeps its orientation in the world. A leg that is too short
to reach its anchor is stretched less than it would have to be.
"""

from dataclasses import dataclass, fields, replace

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.body.kinematics import chunks
from humanmm.models.geometry.intervals import runs_of_true
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat, swing
from humanmm.models.motion.fit.state import LongMotion
from humanmm.models.motion.refine.contacts import STANDS
from humanmm.models.motion.refine.smoothing import fade
from humanmm.models.records.recording import CONTACT_JOINTS

Array = np.ndarray

LEGS = ((1, 4, 7, 10), (2, 5, 8, 11))
"""Hip, knee, ankle, toe base."""


@dataclass(frozen=True)
class LockSettings:
    """How feet are held."""

    fade_s: float = 0.15
    """Time in which a correction fades out before and after a contact."""
    farthest_m: float = 0.12
    """A contact that would move the ankle further than this is not believed."""
    rolled_m: float = 0.05
    """A foot that is held so far from where it is at the end of a phase has left for another place meanwhile: it does
    not roll on."""
    most_rotated: float = 0.6
    """A foot that rotates by more than this (radians) does not stand flat."""
    most_raised: float = 0.8
    """Toes are raised out of the floor by at most so much, radians."""
    floor_reach_m: float = 0.03
    """A sole within this height of the floor stands on the floor; a higher one on something else."""
    floor_below_m: float = 0.1
    """So does one that is less below it; a lower one stands a step down."""
    longest_reach: float = 0.995
    """Largest distance from hip to ankle, as a fraction of the leg's length, to which a lock straightens it."""
    soft_reach: float = 0.97
    """From this fraction on the ankle gets the less near to an anchor the straighter the leg would have to be: where
    anchors stopped legs at 0.999 at once, knees moved at 45 m/s² (99 % of the frames; 31 in truth, 29 now) and stood
    straight in 12 % of them (never in truth)."""


@dataclass(frozen=True, eq=False)
class Leg:
    """One leg over N frames: world positions and rotations of its joints."""

    hip: Float[Array, "N 3"]
    knee: Float[Array, "N 3"]
    ankle: Float[Array, "N 3"]
    toe: Float[Array, "N 3"]
    R_pelvis: Float[Array, "N 3 3"]
    R_hip: Float[Array, "N 3 3"]
    """Thigh to world."""
    R_knee: Float[Array, "N 3 3"]
    """Shin to world."""
    R_ankle: Float[Array, "N 3 3"]
    """Foot to world."""

    @classmethod
    def of(cls, motion: LongMotion, side: int, frames: slice) -> "Leg":
        """The left (0) or right (1) leg in a run of a motion's frames: forward kinematics of these joints alone."""
        R_parent = R_pelvis = rotvec_to_rotmat(motion.vectors[frames, 0])
        rest, parent, position = motion.skeleton.rest_joints, 0, motion.pelvis_ref[frames]
        positions, rotations = [], []
        for joint in LEGS[side]:
            position = position + R_parent @ (rest[joint] - rest[parent])
            R_parent = R_parent @ rotvec_to_rotmat(motion.vectors[frames, joint])
            positions.append(position)
            rotations.append(R_parent)
            parent = joint
        hip, knee, ankle, toe = positions
        R_hip, R_knee, R_ankle, _ = rotations
        return cls(hip, knee, ankle, toe, R_pelvis, R_hip, R_knee, R_ankle)

    def frames(self, chosen: slice) -> "Leg":
        """A run of frames."""
        return Leg(*(getattr(self, field.name)[chosen] for field in fields(self)))


def contact_positions(motion: LongMotion) -> Float[Array, "N 4 3"]:
    """Positions of `CONTACT_JOINTS` in every frame, metres, in the motion's reference frame."""
    positions = np.empty((motion.num_frames, len(CONTACT_JOINTS), 3))
    for frames in chunks(motion.num_frames):
        legs = [Leg.of(motion, side, frames) for side in range(len(LEGS))]
        positions[frames] = np.stack([position for leg in legs for position in (leg.ankle, leg.toe)], axis=1)
    return positions


def lock_feet(
    motion: LongMotion,
    contacts: Float[Array, "N 4"],
    sole_height: Float[Array, " 4"],
    *,
    time_s: Float[Array, " N"],
    settings: LockSettings | None = None,
) -> LongMotion:
    """The motion with its planted feet held; contacts and sole heights are those of `CONTACT_JOINTS`."""
    settings = settings or LockSettings()
    vectors = motion.vectors.copy()
    for side, (hip, knee, ankle, _) in enumerate(LEGS):
        leg = Leg.of(motion, side, slice(None))
        own = slice(2 * side, 2 * side + 2)
        target, R_foot = ankle_targets(leg, contacts[:, own], sole_height[own], time_s=time_s, settings=settings)
        R_foot = _above_floor(leg, target, R_foot, sole_height[own], settings)
        for frames in chunks(motion.num_frames):
            bent = bend_leg(leg.frames(frames), target[frames], R_foot[frames], settings=settings)
            for joint, R in zip((hip, knee, ankle), bent, strict=True):
                vectors[frames, joint] = rotmat_to_rotvec(R)
    return replace(motion, vectors=vectors)


def ankle_targets(
    leg: Leg,
    contacts: Float[Array, "N 2"],
    sole_height: Float[Array, " 2"],
    *,
    time_s: Float[Array, " N"],
    settings: LockSettings | None = None,
) -> tuple[Float[Array, "N 3"], Float[Array, "N 3 3"]]:
    """Where the ankle should be, and the foot's rotation to world: (N,3), (N,3,3).

    `contacts` and `sole_height` are those of ankle and toe base.
    """
    settings = settings or LockSettings()
    holds = contacts >= STANDS
    R_foot = _flat_feet(leg, holds, time_s, settings)
    ball = np.einsum("nab,nb->na", np.swapaxes(leg.R_ankle, -1, -2), leg.toe - leg.ankle)
    toe = leg.ankle + np.einsum("nab,nb->na", R_foot, ball)
    offset, certain = np.zeros_like(leg.ankle), np.zeros(len(leg.ankle), bool)
    previous: tuple[int, Array] | None = None
    moved_on: list[int] = []
    for start, end, by_ankle in _phases(holds):
        position = leg.ankle if by_ankle else toe
        height = sole_height[0 if by_ankle else 1]
        anchor = _anchor(position[start:end], height, settings)
        handed_over = np.zeros(3)
        if previous is not None and previous[0] == start and np.linalg.norm(previous[1][:2]) > settings.rolled_m:
            moved_on.append(start)
        elif previous is not None and previous[0] == start:
            # The foot rolls from heel to ball (or back) within one contact: the new pivot is where the old one left it,
            # and comes to its own height in the time of a fade.
            carried = position[start] + previous[1]
            anchor = np.array([carried[0], carried[1], anchor[2]])
            handed_over[2] = carried[2] - anchor[2]
        since = time_s[start:end] - time_s[max(start - 1, 0)]
        correction = anchor - position[start:end] + fade(since / settings.fade_s)[:, None] * handed_over
        if np.linalg.norm(correction, axis=-1).max() > settings.farthest_m:
            previous = None
            continue
        offset[start:end], certain[start:end] = correction, True
        previous = (end, correction[-1])
    certain[moved_on] = False
    certain = _apart(offset, certain, time_s, settings.farthest_m / settings.fade_s)
    return leg.ankle + _faded(offset, certain, time_s, settings.fade_s), R_foot


def _phases(holds: Bool[Array, "N 2"]) -> list[tuple[int, int, bool]]:
    """[start, end), by the ankle (else by the toe base): runs in which one joint holds the foot, in order.

    Where both hold, the ankle does, for with it the whole sole stands.
    """
    ankle = [(start, end, True) for start, end in runs_of_true(holds[:, 0])]
    toe = [(start, end, False) for start, end in runs_of_true(holds[:, 1] & ~holds[:, 0])]
    return sorted(ankle + toe)


def _anchor(path: Float[Array, "M 3"], sole_height: float, settings: LockSettings) -> Float[Array, " 3"]:
    """The position that a contact holds: the middle of its path, on the floor if that is near."""
    anchor = np.asarray(np.median(path, axis=0))
    if -settings.floor_below_m < anchor[2] - sole_height < settings.floor_reach_m:
        anchor[2] = sole_height
    return anchor


def _flat_feet(leg: Leg, holds: Bool[Array, "N 2"], time_s: Array, settings: LockSettings) -> Float[Array, "N 3 3"]:
    """The feet's rotations, held still while both ankle and toe base stand."""
    correction_rotvec, certain = np.zeros((len(holds), 3)), np.zeros(len(holds), bool)
    for start, end in runs_of_true(np.asarray(holds.all(axis=1))):
        middle = leg.R_ankle[(start + end) // 2]
        spread = rotmat_to_rotvec(middle.T @ leg.R_ankle[start:end])
        mean = middle @ rotvec_to_rotmat(np.median(spread, axis=0))
        to_mean = rotmat_to_rotvec(np.swapaxes(leg.R_ankle[start:end], -1, -2) @ mean)
        if np.linalg.norm(to_mean, axis=-1).max() < settings.most_rotated:
            correction_rotvec[start:end], certain[start:end] = to_mean, True
    certain = _apart(correction_rotvec, certain, time_s, settings.most_rotated / settings.fade_s)
    return np.asarray(leg.R_ankle @ rotvec_to_rotmat(_faded(correction_rotvec, certain, time_s, settings.fade_s)))


def _above_floor(
    leg: Leg,
    ankle: Float[Array, "N 3"],
    R_foot: Float[Array, "N 3 3"],
    sole_height: Float[Array, " 2"],
    settings: LockSettings,
) -> Float[Array, "N 3 3"]:
    """The feet's rotations, toes raised so far that the toe base is not below the floor, nor below an ankle that is."""
    ball = np.einsum("nab,nb->na", R_foot @ np.swapaxes(leg.R_ankle, -1, -2), leg.toe - leg.ankle)
    length = np.linalg.norm(ball, axis=-1)
    least = sole_height[1] + np.minimum(0.0, ankle[:, 2] - sole_height[0]) - ankle[:, 2]
    now, wanted = (np.arcsin(np.clip(height / length, -1, 1)) for height in (ball[:, 2], least))
    axis = np.cross(ball, [0.0, 0.0, 1.0])
    axis /= np.maximum(np.linalg.norm(axis, axis=-1, keepdims=True), 1e-9)
    raised = np.clip(wanted - now, 0.0, settings.most_raised)
    return np.asarray(rotvec_to_rotmat(raised[:, None] * axis) @ R_foot)


def _apart(
    offset: Float[Array, "N C"], certain: Bool[Array, " N"], time_s: Float[Array, " N"], most_per_s: float
) -> Bool[Array, " N"]:
    """Where corrections are certain, without the ends of contacts that follow each other so closely that the foot would
    have to get from one correction to the next faster than `most_per_s`."""
    kept = certain.copy()
    for start, end in runs_of_true(~certain):
        before, after = start - 1, end
        while before >= 0 and after < len(kept) and kept[before] and kept[after]:
            if np.linalg.norm(offset[after] - offset[before]) <= most_per_s * (time_s[after] - time_s[before]):
                break
            kept[before] = kept[after] = False
            before, after = before - 1, after + 1
    return kept


def _faded(
    offset: Float[Array, "N C"], certain: Bool[Array, " N"], time_s: Float[Array, " N"], fade_s: float
) -> Float[Array, "N C"]:
    """Corrections where they are certain, and between them what is left of the neighbours' as they fade out."""
    out = np.where(certain[:, None], offset, 0.0)
    for start, end in runs_of_true(~certain):
        rows = np.arange(start, end)
        before = offset[start - 1] if start > 0 else np.zeros(offset.shape[1])
        after = offset[end] if end < len(certain) else np.zeros(offset.shape[1])
        since = time_s[rows] - time_s[max(start - 1, 0)]
        until = time_s[min(end, len(certain) - 1)] - time_s[rows]
        room = max(since[-1] + until[-1], 1e-9)
        # In a short gap the two fades hand over to each other instead of both reaching zero.
        reach = min(fade_s, room)
        out[rows] = fade(since / reach)[:, None] * before + fade(until / reach)[:, None] * after
    return out


def bend_leg(
    leg: Leg,
    ankle: Float[Array, "N 3"],
    R_foot: Float[Array, "N 3 3"],
    *,
    settings: LockSettings | None = None,
) -> tuple[Float[Array, "N 3 3"], Float[Array, "N 3 3"], Float[Array, "N 3 3"]]:
    """Local rotations of hip, knee and ankle that bring the ankle to its target: the knee bends about its own axis.

    The knee's axis is the one about which the leg is bent, or, in a straight leg, the joint's x axis.
    """
    settings = settings or LockSettings()
    thigh, shin = leg.knee - leg.hip, leg.ankle - leg.knee
    a, b = np.linalg.norm(thigh, axis=-1), np.linalg.norm(shin, axis=-1)
    to_ankle = ankle - leg.hip
    now = np.linalg.norm(leg.ankle - leg.hip, axis=-1)
    # Never straighter than the leg already is or than `longest_reach` allows, and there with no sudden stop: the knee
    # would pop.
    longest = np.maximum(settings.longest_reach * (a + b), np.minimum(now, a + b))
    free = np.minimum(np.maximum(settings.soft_reach * (a + b), now), longest)
    distance = np.maximum(np.linalg.norm(to_ankle, axis=-1), 1.02 * np.abs(a - b) + 0.05)
    beyond, room = np.maximum(distance - free, 0.0), np.maximum(longest - free, 1e-9)
    distance = np.minimum(distance, free) - room * np.expm1(-beyond / room)
    inner_now = np.arccos(np.clip((a**2 + b**2 - now**2) / (2 * a * b), -1, 1))
    inner = np.arccos(np.clip((a**2 + b**2 - distance**2) / (2 * a * b), -1, 1))
    axis = np.cross(thigh, shin)
    sine = np.linalg.norm(axis, axis=-1, keepdims=True) / (a * b)[:, None]
    own = leg.R_hip[..., 0]
    own = np.where(np.sum(own * axis, axis=-1, keepdims=True) < 0, -own, own)
    trust = np.clip(sine / 0.2, 0.0, 1.0)  # a nearly straight leg says little about its axis
    axis = trust * axis / np.maximum(np.linalg.norm(axis, axis=-1, keepdims=True), 1e-9) + (1 - trust) * own
    axis /= np.maximum(np.linalg.norm(axis, axis=-1, keepdims=True), 1e-9)
    R_bend = rotvec_to_rotmat((inner_now - inner)[:, None] * axis)
    bent_shin = np.einsum("nab,nb->na", R_bend, shin)
    R_swing = swing(thigh + bent_shin, to_ankle)
    R_hip, R_knee = R_swing @ leg.R_hip, R_swing @ R_bend @ leg.R_knee
    return (
        np.swapaxes(leg.R_pelvis, -1, -2) @ R_hip,
        np.swapaxes(R_hip, -1, -2) @ R_knee,
        np.swapaxes(R_knee, -1, -2) @ R_foot,
    )
