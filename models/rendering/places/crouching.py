"""Takes performed with bent knees: how deep people stand is what tells fighters and dancers from walkers.

In the packs that the networks are trained on knees are bent by 30 degrees in the median and ankles 0.46 leg's lengths
apart; people who fight or do tai chi have them at 60 degrees, and a whole leg's length apart. A crouched take keeps its
arms, and its feet on the floor: where they were, or farther apart.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat, swing, unit
from humanmm.models.rendering.places.recombination import unsteady
from humanmm.models.synthetic.mocap import MocapSequence, leg_length

Array = np.ndarray

CROUCHED = 0.4
"""How often a take is shown crouched to a network that learns."""
HIPS, KNEES, ANKLES = (1, 2), (4, 5), (7, 8)
"""Left, right."""
DEEPEST, UNSTEADY = 0.3, 0.03
"""The pelvis is lowered by at most so much of the legs' length, and how much that changes from moment to moment
(standard deviation)."""
UPRIGHT = (0.6, 0.85)
"""Height of the pelvis over the lower ankle, in lengths of a leg: who is as low as the first is not lowered any more,
who is higher than the second fully."""
LEAN_RAD = (-0.15, 0.25)
"""How far the trunk leans forwards where the pelvis is lowest. Those who are always bent forwards there (0 to 0.4)
teach a network that everybody is who has his knees bent: a tai chi master in three shots then leans 10, 10 and 5
degrees too far (5, 1 and 4 before)."""
BACK = 0.7
"""How far the pelvis moves back, in parts of how far it is lowered, at most."""
WIDER, LONGER = 0.35, 0.5
REACHED = 0.95
"""How far each foot is put to its side, and forwards or back, at most, in lengths of a leg; as far as legs reach in so
many frames."""
OUTWARDS_RAD = (-0.15, 0.5)
"""How far the legs turn about the lines from hips to ankles, knees outwards, where the pelvis is lowest."""
STRAIGHTEST, MOST_BENT = 0.998, 0.35
"""A leg reaches over at most, and at least, so much of its length."""


def crouched(take: MocapSequence, rng: np.random.Generator) -> MocapSequence:
    """The take with its pelvis lower, its trunk leaning and its feet apart, all by chance."""
    body = load_body()
    rest = body.rest_joints(np.zeros(body.num_betas))
    joints, R_world_joint = forward_kinematics(rest, take.R_world_root, take.body_pose, take.pelvis)
    low, high = UPRIGHT
    height = (take.pelvis[:, 2] - joints[:, ANKLES, 2].min(axis=1)) / take.leg_m
    can_be = np.clip((height - low) / (high - low), 0, 1)
    share = can_be * np.clip(rng.uniform() + unsteady(take, (), 0.0, UNSTEADY / DEEPEST, rng), 0, 1)
    lowered = DEEPEST * take.leg_m * share
    forwards = _forwards(take.R_world_root)
    aside = np.cross([0.0, 0.0, 1.0], forwards)
    """To the left."""
    R_root = rotvec_to_rotmat((share * rng.uniform(*LEAN_RAD))[:, None] * aside) @ take.R_world_root
    pelvis = take.pelvis - lowered[:, None] * ([0.0, 0.0, 1.0] + rng.uniform(0, BACK) * forwards)
    apart = take.leg_m * can_be[:, None] * (rng.uniform(0, WIDER) * aside + rng.uniform(-LONGER, LONGER) * forwards)
    hips = pelvis[:, None] + (rest[list(HIPS)] - rest[0]) @ np.swapaxes(R_root, 1, 2)
    reaches = np.moveaxis(_reaches(joints[:, ANKLES], apart, hips, leg_length(rest)), 1, 0)
    outwards = share * rng.uniform(*OUTWARDS_RAD)
    pose = take.body_pose.copy()
    for hip, knee, ankle, sign, reach in zip(HIPS, KNEES, ANKLES, (1.0, -1.0), reaches, strict=True):
        thigh, shank = rest[knee] - rest[hip], rest[ankle] - rest[knee]
        R_knee = _bent_knee(rotvec_to_rotmat(pose[:, knee - 1]), thigh, shank, np.linalg.norm(reach, axis=-1))
        turned = rotvec_to_rotmat((-sign * outwards)[:, None] * unit(reach))
        leg = np.einsum("nij,nj->ni", R_world_joint[:, hip], thigh + R_knee @ shank)
        R_hip = turned @ swing(leg, reach) @ R_world_joint[:, hip]
        pose[:, hip - 1] = rotmat_to_rotvec(np.swapaxes(R_root, -1, -2) @ R_hip)
        pose[:, knee - 1] = rotmat_to_rotvec(R_knee)
        pose[:, ankle - 1] = rotmat_to_rotvec(np.swapaxes(R_hip @ R_knee, -1, -2) @ R_world_joint[:, ankle])
    return replace(take, R_world_root=R_root, body_pose=pose, pelvis=pelvis)


def _forwards(R_world_root: Float[Array, "N 3 3"]) -> Float[Array, "N 3"]:
    """Where the pelvis faces along the floor; who bends over or lies still faces somewhere."""
    ahead = R_world_root[..., 2] * [1, 1, 0] + 1e-6
    return unit(ahead * [1, 1, 0])


def _reaches(
    ankles: Float[Array, "N 2 3"], apart: Float[Array, "N 3"], hips: Float[Array, "N 2 3"], leg_m: float
) -> Float[Array, "N 2 3"]:
    """From hips to ankles, the left put aside by `apart` and the right by its opposite, or by a part of it."""
    for part in np.linspace(1, 0, 11):
        reaches = ankles + part * np.stack([apart, -apart], axis=1) - hips
        if (np.linalg.norm(reaches, axis=-1).max(axis=1) < leg_m).mean() >= REACHED:
            break
    return np.asarray(reaches)


def _bent_knee(
    R_knee: Float[Array, "N 3 3"], thigh: Float[Array, " 3"], shank: Float[Array, " 3"], reach: Float[Array, " N"]
) -> Float[Array, "N 3 3"]:
    """The knee's rotation, turned about its hinge (x) until the ankle is so far from the hip.

    |thigh + R_knee Rx(δ) shank|² = c₀ + c₁ cos δ + c₂ sin δ; of two solutions the one that is bent forwards.
    """
    above = np.einsum("nji,j->ni", R_knee, thigh)
    _, y, z = shank
    c0 = thigh @ thigh + shank @ shank + 2 * above[:, 0] * shank[0]
    c1, c2 = 2 * (above[:, 1] * y + above[:, 2] * z), 2 * (above[:, 2] * y - above[:, 1] * z)
    longest = np.linalg.norm(thigh) + np.linalg.norm(shank)
    length = np.clip(reach, MOST_BENT * longest, STRAIGHTEST * longest)
    delta = np.arctan2(c2, c1) + np.arccos(np.clip((length**2 - c0) / np.hypot(c1, c2), -1, 1))
    return np.asarray(R_knee @ rotvec_to_rotmat(delta[:, None] * [1.0, 0.0, 0.0]))
