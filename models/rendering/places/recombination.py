"""Motion that nobody performed: the arms of one take on the body of another, where they do not run into it.

Every joint keeps angles that somebody had, so that joint limits hold. What the legs do, and with it path and contacts,
stays as it was.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from humanmm.models.body.body24 import Body, load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.geometry.intervals import runs_of_true
from humanmm.models.synthetic.mocap import MocapSequence, resample

Array = np.ndarray

ARM_JOINTS = (13, 14, 16, 17, 18, 19, 20, 21, 22, 23)
SHORTEST_S, LONGEST_S = 1.5, 8.0
_ARM_POINTS = (18, 19, 20, 21, 22, 23)
_CORES = ((0, 9, 0.08), (9, 12, 0.06), (12, 15, 0.07), (1, 4, 0.05), (2, 5, 0.05), (4, 7, 0.03), (5, 8, 0.03))
"""From joint to joint, with the radius of what no arm enters, metres (captured ones do in 2 % of the frames)."""


def with_arms_of(take: MocapSequence, other: MocapSequence, rng: np.random.Generator) -> MocapSequence | None:
    """A part of the take, LONGEST_S or shorter, with the other's arms; None where they are not free for SHORTEST_S."""
    seconds = min(LONGEST_S, *((one.num_frames - 1) / one.fps for one in (take, other)))
    count = int(seconds * take.fps + 1e-6) + 1
    start = int(rng.integers(take.num_frames - count + 1))
    latest = (other.num_frames - 1) / other.fps - seconds
    arms = resample(other, rng.uniform(0, max(latest, 0.0)), count, take.fps)
    made = take.cropped(start, count)
    pose, rows = made.body_pose.copy(), [joint - 1 for joint in ARM_JOINTS]
    pose[:, rows] = arms.body_pose[:, rows]
    made = replace(made, body_pose=pose)
    free = runs_of_true(clearance_m(made, load_body()) > 0)
    longest = max(free, key=lambda run: run.end - run.start, default=None)
    if longest is None or longest.end - longest.start < SHORTEST_S * take.fps:
        return None
    return made.cropped(longest.start, longest.end - longest.start)


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
