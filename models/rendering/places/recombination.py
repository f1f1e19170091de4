"""Motion that nobody performed: limbs of several takes on one body, where arms do not run into it."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.body.body24 import Body, load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.geometry.intervals import runs_of_true
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.synthetic.mocap import MocapSequence, resample

Array = np.ndarray

LEFT_ARM, RIGHT_ARM = (13, 16, 18, 20, 22), (14, 17, 19, 21, 23)
LIMBS: tuple[tuple[int, ...], ...] = (LEFT_ARM, RIGHT_ARM, (1, 4, 7, 10), (2, 5, 8, 11))
"""Joints of each arm and leg."""
SHORTEST_S, LONGEST_S = 1.5, 8.0
HINGES, BALLS = (4, 5, 18, 19), (1, 2, 3, 6, 9, 12, 15, 16, 17)
"""Knees and elbows, and what turns about more than one axis."""
TRUNK = (3, 6, 9, 12, 15)
BEND, BENDING = 0.2, 0.15
"""By how much knees and elbows of a loosened take bend more or less: standard deviation of the logarithm of their
angles, for all of it, and from moment to moment."""
TURN_RAD, TURNING_RAD = 0.12, 0.1
"""The same of the other joints' rotations, each axis; half as much for those of the trunk."""
LEAN_RAD, LEANING_RAD = 0.1, 0.08
"""The same of the whole body."""
MOMENT_S = 0.7
SHORTEST_LOOSE_S = 0.7
TOUCHING_M = -0.02
"""Where arms of a loosened take may be: captured ones lie on the body, too."""
_ARM_POINTS = (18, 19, 20, 21, 22, 23)
_CORES = ((0, 9, 0.08), (9, 12, 0.06), (12, 15, 0.07), (1, 4, 0.05), (2, 5, 0.05), (4, 7, 0.03), (5, 8, 0.03))
"""From joint to joint, with the radius of what no arm enters, metres (captured ones do in 2 % of the frames)."""


def with_arms_of(take: MocapSequence, other: MocapSequence, rng: np.random.Generator) -> MocapSequence | None:
    """A part of the take, LONGEST_S or shorter, with the other's arms; None where they are not free for SHORTEST_S.

    Every joint keeps angles that somebody had, so that joint limits hold. What the legs do, and with it path and
    contacts, stays as it was.
    """
    made = _with_limbs_of(take, {LEFT_ARM + RIGHT_ARM: other}, rng)
    return _longest(made, clearance_m(made, load_body()) > 0, SHORTEST_S)


def loosened(take: MocapSequence, others: Sequence[MocapSequence], rng: np.random.Generator) -> MocapSequence | None:
    """A part of the take, LONGEST_S or shorter, of whose limbs every other one is that of another take, and whose
    angles are all a little off, as another person's would be; None where arms are not free for SHORTEST_LOOSE_S.

    Who learns from it learns less of how limbs go together. Contacts stay as they were and need not be true.
    """
    replaced = [limb for limb in LIMBS if rng.random() < 0.5]
    strangers = {limb: others[int(rng.integers(len(others)))] for limb in replaced}
    made = _with_limbs_of(take, strangers, rng)
    pose = made.body_pose.copy()
    bent = [joint - 1 for joint in HINGES]
    pose[:, bent] *= np.exp(unsteady(made, (len(bent), 1), BEND, BENDING, rng))
    turned = [joint - 1 for joint in BALLS]
    turn = unsteady(made, (len(turned), 3), TURN_RAD, TURNING_RAD, rng)
    turn[:, [BALLS.index(joint) for joint in TRUNK]] /= 2
    pose[:, turned] = rotmat_to_rotvec(rotvec_to_rotmat(turn) @ rotvec_to_rotmat(pose[:, turned]))
    R_root = rotvec_to_rotmat(unsteady(made, (3,), LEAN_RAD, LEANING_RAD, rng)) @ made.R_world_root
    made = replace(made, body_pose=pose, R_world_root=R_root)
    return _longest(made, clearance_m(made, load_body()) > TOUCHING_M, SHORTEST_LOOSE_S)


def _with_limbs_of(
    take: MocapSequence, strangers: Mapping[tuple[int, ...], MocapSequence], rng: np.random.Generator
) -> MocapSequence:
    """A part of the take in which some joints have the angles of other takes; as long as all of them, or LONGEST_S."""
    seconds = min(LONGEST_S, *((one.num_frames - 1) / one.fps for one in (take, *strangers.values())))
    count = int(seconds * take.fps + 1e-6) + 1
    made = take.cropped(int(rng.integers(take.num_frames - count + 1)), count)
    pose = made.body_pose.copy()
    for joints, other in strangers.items():
        latest = (other.num_frames - 1) / other.fps - seconds
        part = resample(other, rng.uniform(0, max(latest, 0.0)), count, take.fps)
        rows = [joint - 1 for joint in joints]
        pose[:, rows] = part.body_pose[:, rows]
    return replace(made, body_pose=pose)


def unsteady(
    take: MocapSequence, shape: tuple[int, ...], lasting: float, passing: float, rng: np.random.Generator
) -> Float[Array, "N *shape"]:
    """Random numbers of every frame, part of which stays, and part of which is another after a MOMENT_S: standard
    deviations of both."""
    knots = int((take.num_frames - 1) / take.fps / MOMENT_S) + 2
    passed = rng.normal(0, passing, (knots, *shape))
    at = np.linspace(0, knots - 1, take.num_frames)
    before = np.minimum(at.astype(int), knots - 2)
    fraction = (at - before).reshape(-1, *([1] * len(shape)))
    smooth = fraction**2 * (3 - 2 * fraction)
    return np.asarray(rng.normal(0, lasting, shape) + (1 - smooth) * passed[before] + smooth * passed[before + 1])


def _longest(take: MocapSequence, good: Bool[Array, " N"], shortest_s: float) -> MocapSequence | None:
    """The longest run of good frames; None if it is shorter than that."""
    longest = max(runs_of_true(good), key=lambda run: run.end - run.start, default=None)
    if longest is None or longest.end - longest.start < shortest_s * take.fps:
        return None
    return take.cropped(longest.start, longest.end - longest.start)


def clearance_m(take: MocapSequence, body: Body) -> Float[Array, " N"]:
    """How near elbows, wrists and hands come to the cores of trunk, head and legs of the mean body; < 0: inside."""
    joints, _ = forward_kinematics(body.rest_joints(np.zeros(10)), take.R_world_root, take.body_pose, take.pelvis)
    points = joints[:, list(_ARM_POINTS)]
    nearest = np.full(len(joints), np.inf)
    for a, b, radius in _CORES:
        start, along = joints[:, None, a], joints[:, None, b] - joints[:, None, a]
        at = np.clip(((points - start) * along).sum(axis=-1) / (along**2).sum(axis=-1), 0, 1)
        gap = np.linalg.norm(points - start - at[..., None] * along, axis=-1) - radius
        nearest = np.minimum(nearest, gap.min(axis=1))
    return nearest
