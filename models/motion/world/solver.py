"""Positions of all people and cameras: one sparse least squares over the whole video.

The rotations are known up to a few degrees (from the cuts), each person's position in front of the camera up to its
depth, and the path of a moving camera up to its scale. What ties them together:

- the person is where the picture shows: tightly across the line of sight, above all from frame to frame, loosely along
  it;
- everybody has one size, which all his distances go by and which his picture hardly tells;
- all distances go by one focal length: what moves away from the camera and what moves across it must fit;
- a planted foot does not move, and one that bears the body is on the floor, z = 0; along the line of sight fitted legs
  swing too little, so that feet say less there the faster somebody comes or goes;
- bodies have inertia, also across a cut: that ties the shots together;
- the floor that a moving camera sees gives its path a scale (`scale`);
- every shot is about as level as its people and its camera say, and rotated against the others as the cuts say.

Unknown are the pelvis of every person in every frame, everybody's size, the focal length as far as it is uncertain, and
for each shot the camera's position, a small rotation and the scale of its path. All of it is linear but for the small
rotations and the robust weights: a few Gauss-Newton steps with iteratively reweighted residuals. Time and memory grow
linearly with the video.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.world.camera_terms import add_levels, add_same_cameras, add_scales
from humanmm.models.motion.world.equations import CAMERA_UNKNOWNS, SCALE, WorldEquations
from humanmm.models.motion.world.feet import hold, put_on_floor
from humanmm.models.motion.world.people_terms import equations_of_people
from humanmm.models.motion.world.problem import CameraEdge, SameCamera, ShotRig, ShotTrajectory
from humanmm.models.motion.world.scale import LogScale, scale_from_feet, scale_from_floor
from humanmm.models.motion.world.state import SolveSettings, WorldState, as_solved, people_of

Array = np.ndarray

STILL_FROM, FLOOR_FROM, FREE_FROM = 1, 4, 4
"""Steps from which feet that stand still count, the floor counts, and shots may turn and the focal length change."""
DAMPING = 1e-6
"""Added to the diagonal for every unknown, so that the matrix is not singular where nothing is known: as if every step
were zero but for a kilometre, a thousand radians, a factor of e¹⁰⁰⁰."""
HELD = 1e12
"""The same for all unknowns of cameras that are known, and for a focal length that is."""
KEPT, KEPT_DIMENSIONLESS = 1e6, 1e8
"""Added for positions (1/m²), and for rotations, scales and the focal length (1), that are not to change yet or at all:
as if a step were zero but for a millimetre, and but for 1e-4 of a radian or of the logarithm."""


@dataclass(frozen=True)
class Solution:
    """The world after the solve: K trajectories of N_k frames, S shots; world axes (z up, floor at z = 0), metres."""

    pelvis: tuple[Float[Array, "N_k 3"], ...]
    """Per trajectory, in the order given."""
    contacts: tuple[Float[Array, "N_k 4"], ...]
    """Per trajectory: how surely each sole point stands still on the floor, 0..1."""
    rotation: Float[Array, "S 3 3"]
    """Small rotation of each shot: multiply world rotations and offsets of the shot from the left."""
    origin: Float[Array, "S 3"]
    """Position of the shot's origin."""
    scale: Float[Array, " S"]
    """Metres per unit of the shot's path."""
    log_scale_std: Float[Array, " S"]
    """Standard deviation of the logarithm of the scale of a path that was not known, against the people's size."""
    from_floor: Bool[Array, " S"]
    """Whether the floor gave the scale."""
    size: Mapping[int, float]
    """By person: how many times as large he is as his shots have him."""
    focal: float
    """How many times as long the focal length is as it was thought to be."""


def solve(
    trajectories: Sequence[ShotTrajectory],
    rigs: Sequence[ShotRig],
    edges: Sequence[CameraEdge],
    same: Sequence[SameCamera] = (),
    *,
    focal_std: float = 0.0,
) -> Solution:
    """Positions of people and cameras, the scale of each camera's path and small corrections of each shot's
    rotation.

    `focal_std`: standard deviation of the logarithm of the focal length by which the trajectories were made.
    """
    settings = SolveSettings()
    shots = len(rigs)
    of_shot: list[list[ShotTrajectory]] = [[] for _ in rigs]
    for trajectory in trajectories:
        of_shot[trajectory.shot].append(trajectory)
    floors = [None if rig.scale_known else scale_from_floor(rig, own) for rig, own in zip(rigs, of_shot, strict=True)]
    scale = np.array([
        np.exp(floor.mean) if floor is not None else rig.scale if rig.scale_known else scale_from_feet(rig, own)
        for rig, own, floor in zip(rigs, of_shot, floors, strict=True)
    ])  # fmt: skip
    state = WorldState(
        [s.offset.copy() for s in trajectories],
        np.tile(np.eye(3), (shots, 1, 1)),
        np.zeros((shots, 3)),
        scale,
        np.zeros(len(people_of(trajectories))),
        0.0,
    )
    # The first steps join the shots by inertia alone; then feet that stand still count; then the floor.
    for iteration in range(settings.iterations):
        if iteration == FLOOR_FROM:
            state = put_on_floor(as_solved(trajectories, state), rigs, state, settings)
        before = state
        state, equations = _step(trajectories, rigs, floors, edges, same, state, settings, iteration, focal_std)
        if iteration > FLOOR_FROM and _moved(before, state) < settings.converged_m:
            break
    return Solution(
        pelvis=tuple(state.pelvis),
        contacts=_contacts(trajectories, rigs, state, settings),
        rotation=state.rotation,
        origin=state.origin,
        scale=state.scale,
        log_scale_std=np.hypot(
            equations.std(np.array([equations.camera(shot)[SCALE] for shot in range(shots)])) / state.scale,
            settings.log_scale_std,
        ),
        from_floor=np.array([floor is not None for floor in floors]),
        size=dict(zip(people_of(trajectories), np.exp(state.log_size).tolist(), strict=True)),
        focal=float(np.exp(state.log_focal)),
    )


def with_riders(world: Solution, trajectories: Sequence[ShotTrajectory], rigs: Sequence[ShotRig]) -> Solution:
    """The world with the trajectories of people who say nothing of its cameras, behind those that it was solved from:
    they are placed before the cameras as these are. Their trajectories have the world's focal length."""
    if not trajectories:
        return world
    settings, people = SolveSettings(), people_of(trajectories)
    # Who is a witness in another shot is as large here as there.
    trajectories = [
        replace(one.grown(world.size[one.person]), size_known=True) if one.person in world.size else one
        for one in trajectories
    ]
    seen = [
        world.origin[one.shot]
        + (world.scale[one.shot] * rigs[one.shot].path[one.frame - rigs[one.shot].start] + one.offset)
        @ world.rotation[one.shot].T
        for one in trajectories
    ]
    state = WorldState(seen, world.rotation, world.origin, world.scale, np.zeros(len(people)), 0.0)
    for iteration in range(FREE_FROM, settings.iterations):
        before = state
        state, _ = _step(trajectories, rigs, [None] * len(rigs), (), (), state, settings, iteration, 0.0, held=True)
        if _moved(before, state) < settings.converged_m:
            break
    return replace(
        world,
        pelvis=(*world.pelvis, *state.pelvis),
        contacts=(*world.contacts, *_contacts(trajectories, rigs, state, settings)),
        size={**dict(zip(people, np.exp(state.log_size).tolist(), strict=True)), **world.size},
    )


def _moved(before: WorldState, after: WorldState) -> float:
    """How far anybody has moved at most, along one axis, metres."""
    return max((float(np.abs(a - b).max()) for a, b in zip(after.pelvis, before.pelvis, strict=True)), default=0.0)


def _contacts(
    trajectories: Sequence[ShotTrajectory], rigs: Sequence[ShotRig], state: WorldState, settings: SolveSettings
) -> tuple[Float[Array, "N_k 4"], ...]:
    """How surely each sole point stands still on the floor."""
    solved = as_solved(trajectories, state)
    return tuple(hold(one, rigs[one.shot], state, k, settings)[1] for k, one in enumerate(solved))


def _step(
    trajectories: Sequence[ShotTrajectory],
    rigs: Sequence[ShotRig],
    floors: Sequence[LogScale | None],
    edges: Sequence[CameraEdge],
    same: Sequence[SameCamera],
    state: WorldState,
    settings: SolveSettings,
    iteration: int,
    focal_std: float,
    *,
    held: bool = False,
) -> tuple[WorldState, WorldEquations]:
    """The state after one Gauss-Newton step, and the equations that gave it. `held`: the cameras are known."""
    order = sorted(range(len(trajectories)), key=lambda k: (trajectories[k].person, int(trajectories[k].frame[0])))
    equations = equations_of_people(
        [trajectories[k] for k in order],
        rigs,
        state.ordered(order),
        settings,
        robust=iteration > 0,
        still=iteration >= STILL_FROM,
        floor=iteration >= FLOOR_FROM,
        held=held,
    )
    add_levels(equations, rigs, edges, state, settings)
    add_scales(equations, floors, state, settings)
    add_same_cameras(equations, rigs, same, state)
    if focal_std > 0:
        equations.add_shared(np.array([state.log_focal / focal_std]), (equations.focal, np.array([[1 / focal_std]])))

    damping = np.full(len(equations.shared_gradient), DAMPING)
    of_cameras = damping[: CAMERA_UNKNOWNS * len(rigs)].reshape(-1, CAMERA_UNKNOWNS)
    of_cameras[0, :2] = KEPT  # the first camera stays where it is, but for its height
    if iteration < FLOOR_FROM:
        of_cameras[0, 2] = KEPT
    of_cameras[0, 5] = KEPT_DIMENSIONLESS  # nor does it turn
    if iteration < FREE_FROM:
        of_cameras[:, 3:6] = KEPT_DIMENSIONLESS
    if iteration < FREE_FROM:
        damping[equations.focal] = KEPT_DIMENSIONLESS
    known = np.array([rig.scale_known or not np.any(rig.path) for rig in rigs])
    of_cameras[known, SCALE] = KEPT_DIMENSIONLESS
    if held:
        of_cameras[:] = HELD
    if held or focal_std <= 0:
        damping[equations.focal] = HELD
    steps, shared = equations.step(DAMPING, damping)
    moved = shared[: of_cameras.size].reshape(-1, CAMERA_UNKNOWNS)
    pelvis = list(state.pelvis)
    for k, segment in zip(order, equations.segments, strict=True):
        pelvis[k] = pelvis[k] + steps[segment.start : segment.stop]
    after = WorldState(
        pelvis=pelvis,
        rotation=rotvec_to_rotmat(moved[:, 3:6]) @ state.rotation,
        origin=state.origin + moved[:, :3],
        # A scale neither changes sign nor runs away in one step.
        scale=np.clip(state.scale + moved[:, SCALE], 0.3 * state.scale, 3.0 * state.scale),
        log_size=state.log_size + shared[of_cameras.size : -1],
        log_focal=state.log_focal + float(shared[-1]),
    )
    return after, equations
