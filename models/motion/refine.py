"""One motion over all shots (paper section 3.3.3): seams closed, gaps filled, smooth, feet on one floor.

In order: the poses of neighbouring shots are made one at the cut; rotations are smoothed and gaps filled in; feet that
stand are found; the pelvis' way is solved again with them; then they are found once more on the better way, held by
inverse kinematics, and the floor is put under them. Cameras keep their rotations; their centres move with the floor and
the origin alone.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from humanmm.models.body.body24 import Body, load_body
from humanmm.models.body.kinematics import compose
from humanmm.models.body.rotations import rotation_from_vector, vector_from_rotation
from humanmm.models.motion.contacts import CONTACT_JOINTS, ContactModel, contact_probabilities
from humanmm.models.motion.footlock import LEGS, Leg, LockSettings, ankle_targets, bend_leg
from humanmm.models.motion.refine_seams import close_seams
from humanmm.models.motion.refine_smoothing import smooth, smooth_rotations
from humanmm.models.motion.refine_trajectory import TrajectoryNoise, solve_trajectory
from humanmm.models.motion.results import PersonMotion, WorldMotion

Array = np.ndarray

CHUNK_FRAMES = 512
"""Frames whose whole kinematics are in memory at the same time."""

FLOOR_QUANTILE = 0.3
"""Share of the standing time that may be below the floor: people also stand on things, never under the ground."""

FLOOR_NEAR_M = 0.10
"""Contacts this near to the floor found so far decide where it really is."""

_LEG_JOINTS = tuple(joint for leg in LEGS for joint in leg)


@dataclass(frozen=True)
class RefineSettings:
    """What can be set, and what can be left out (for ablations)."""

    cutoff_hz: float = 8.0
    close_seams: bool = True
    trajectory: bool = True
    foot_lock: bool = True
    contacts: ContactModel = field(default_factory=ContactModel)
    noise: TrajectoryNoise = field(default_factory=TrajectoryNoise)
    lock: LockSettings = field(default_factory=LockSettings)


def refine_world(
    world: WorldMotion,
    *,
    time_s: Float[Array, " F"],
    cut_frames: tuple[int, ...],
    settings: RefineSettings | None = None,
) -> WorldMotion:
    """All people refined; floor at z = 0, first person's first pelvis above the origin."""
    settings = settings or RefineSettings()
    people = [
        refine_person(person, world.t_world_cam, time_s=time_s, cut_frames=cut_frames, settings=settings)
        for person in world.people
    ]
    return at_origin(replace(world, people=tuple(people)))


def refine_person(
    person: PersonMotion,
    t_world_cam: Float[Array, "F 3"],
    *,
    time_s: Float[Array, " F"],
    cut_frames: tuple[int, ...],
    settings: RefineSettings,
) -> PersonMotion:
    """One person's motion, with contacts."""
    time, observed = time_s[person.frame], person.observed
    if not observed.any():
        return person
    body = load_body()
    rest_joints = body.rest_joints(person.betas)
    sole = sole_heights(body, person.betas)
    R = _local_rotations(person)
    if settings.close_seams:
        R = close_seams(R, frame=person.frame, observed=observed, time_s=time, cut_frames=cut_frames)
    weight = np.where(observed, np.clip(person.confidence, 0.05, 1.0), 0.0)
    R = smooth_rotations(R, weight, time, cutoff_hz=settings.cutoff_hz)
    pelvis = smooth(person.pelvis_world, weight, time, cutoff_hz=settings.cutoff_hz)
    legs = leg_joints(rest_joints, R)
    feet = legs.positions[:, _FEET]
    centre = t_world_cam[person.frame]
    contacts = np.zeros((len(time), 4))
    for _ in range(2 if settings.trajectory else 1):
        ray = (pelvis - centre) / np.maximum(np.linalg.norm(pelvis - centre, axis=-1, keepdims=True), 1e-6)
        contacts = contact_probabilities(
            feet + pelvis[:, None], sole, time_s=time, ray=ray, observed=observed, model=settings.contacts
        )
        if settings.trajectory:
            pelvis = solve_trajectory(
                person.pelvis_world,
                feet,
                contacts,
                sole,
                camera_centre=centre,
                observed=observed,
                time_s=time,
                noise=settings.noise,
            )
    if settings.foot_lock:
        R = lock_feet(R, legs, pelvis, contacts, sole, time_s=time, settings=settings.lock)
    return replace(
        person,
        R_world_root=R[:, 0],
        body_pose=vector_from_rotation(R[:, 1:]),
        pelvis_world=pelvis,
        contacts=contacts.astype(np.float32),
    )


def _local_rotations(person: PersonMotion) -> Float[Array, "N 24 3 3"]:
    return np.concatenate([person.R_world_root[:, None], rotation_from_vector(person.body_pose)], axis=1)


@dataclass(frozen=True, eq=False)
class LegJoints:
    """Pelvis and both legs over N frames, pelvis at the origin: joints in the order of `_LEG_JOINTS`."""

    positions: Float[Array, "N 8 3"]
    R_world_joint: Float[Array, "N 8 3 3"]

    def leg(self, side: int, pelvis: Float[Array, "N 3"], R_root: Float[Array, "N 3 3"]) -> Leg:
        """The left (0) or right (1) leg in the world."""
        first = 4 * side
        hip, knee, ankle, toe = (self.positions[:, first + k] + pelvis for k in range(4))
        R_hip, R_knee, R_ankle = (self.R_world_joint[:, first + k] for k in range(3))
        return Leg(hip, knee, ankle, toe, R_root, R_hip, R_knee, R_ankle)


_FEET = tuple(_LEG_JOINTS.index(joint) for joint in CONTACT_JOINTS)


def leg_joints(rest_joints: Float[Array, "24 3"], R_local: Float[Array, "N 24 3 3"]) -> LegJoints:
    """Forward kinematics of the legs, a chunk of frames at a time."""
    positions, rotations = [], []
    for start in range(0, len(R_local), CHUNK_FRAMES):
        chunk = R_local[start : start + CHUNK_FRAMES]
        joints, R = compose(rest_joints, chunk, np.zeros((len(chunk), 3)))
        positions.append(joints[:, _LEG_JOINTS])
        rotations.append(R[:, _LEG_JOINTS])
    return LegJoints(np.concatenate(positions), np.concatenate(rotations))


def sole_heights(body: Body, betas: Float[Array, " 10"]) -> Float[Array, " 4"]:
    """Height above the ground of left ankle, left toe base, right ankle, right toe base of the rest pose, metres."""
    ground = float(body.rest_vertices(betas)[:, 1].min())
    return np.asarray(body.rest_joints(betas)[list(CONTACT_JOINTS), 1] - ground)


def lock_feet(
    R_local: Float[Array, "N 24 3 3"],
    legs: LegJoints,
    pelvis: Float[Array, "N 3"],
    contacts: Float[Array, "N 4"],
    sole_height: Float[Array, " 4"],
    *,
    time_s: Float[Array, " N"],
    settings: LockSettings,
) -> Float[Array, "N 24 3 3"]:
    """Local rotations with planted feet."""
    locked = R_local.copy()
    for side, (hip, knee, ankle, _) in enumerate(LEGS):
        leg = legs.leg(side, pelvis, R_local[:, 0])
        places = slice(2 * side, 2 * side + 2)
        target, R_foot = ankle_targets(leg, contacts[:, places], sole_height[places], time_s=time_s, settings=settings)
        locked[:, hip], locked[:, knee], locked[:, ankle] = bend_leg(leg, target, R_foot, settings=settings)
    return locked


def at_origin(world: WorldMotion) -> WorldMotion:
    """The same world, its origin under the first person's first pelvis."""
    if not world.people:
        return world
    shift = world.people[0].pelvis_world[0] * [1.0, 1.0, 0.0]
    people = tuple(replace(person, pelvis_world=person.pelvis_world - shift) for person in world.people)
    return replace(world, people=people, t_world_cam=world.t_world_cam - shift)
