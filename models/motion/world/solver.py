"""Positions of all people and cameras: one sparse least squares over the whole video.

The rotations are known up to a few degrees (from the cuts), each person's position in front of the camera up to its
depth, and the path of a moving camera up to its scale. What ties them together:

- the person is where the picture shows: tightly across the line of sight, loosely along it;
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
from scipy.ndimage import gaussian_filter1d

from humanmm.models.geometry.robust import cauchy_weight, huber_weight
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat, skew, unit
from humanmm.models.motion.world.equations import (
    CAMERA_UNKNOWNS,
    SCALE,
    SHARED_UNKNOWNS,
    WorldEquations,
    segments_of,
)
from humanmm.models.motion.world.problem import CameraEdge, SameCamera, ShotRig, ShotTrajectory
from humanmm.models.motion.world.scale import LOWEST_PERCENT, LogScale, scale_from_feet, scale_from_floor

Array = np.ndarray


@dataclass(frozen=True)
class SolveSettings:
    """Standard deviations of what ties the world together, as measured on fits to rendered people."""

    across_m: float = 0.02
    """Error of the pelvis across the line of sight."""
    depth_fraction: float = 0.016
    """Error of the pelvis along the line of sight that changes within a shot, as a fraction of the distance."""
    taller_std: float = 0.07
    smaller_std: float = 0.12
    """Of the logarithm of a person's size, which all his distances go by: the bones that a pose network sees say little
    about it. Somebody may be a child."""
    known_size_std: float = 0.01
    """The same of somebody whose height is known. If nobody's is, the mean of all is taken for known: speeds and
    accelerations are least in a world that is shrunk, and would shrink everybody."""
    correlation_s: float = 0.4
    """Errors of observations change this slowly."""
    still_ms: float = 0.15
    """Speed of a foot that stands still across the line of sight, with the noise of the fitted leg."""
    still_along_ms: float = 0.4
    """The same along the line of sight."""
    swing_fraction: float = 1.0
    """The same, as a fraction of the speed with which somebody comes or goes: fitted legs swing in depth by 0.4 to 0.7
    of what they should (median), all points of both feet alike."""
    moving: float = 2.0
    """A foot certainly moves that is so many times as fast."""
    floor_m: float = 0.1
    """Height of a sole point that bears the body; the four points of a body err together."""
    acceleration_ms2: float = 6.0
    level_deg: float = 4.0
    """Error of a shot's vertical before the solve, where its own evidence claims no less."""
    heading_trust: float = 2.0
    """How many times as certain of its heading a shot is held to be: feet and paths of people who spin or roll on the
    floor are mostly wrong. With 1 cameras of clips in which people walk turn less wrongly (5.9 instead of 6.2° in the
    mean), those of acrobats more."""
    floor_scale_reach: float = 3.0
    """Standard deviations from which the scale that the floor gives counts less (the scale of a Cauchy kernel)."""
    log_scale_std: float = 0.15
    """Error of the logarithm of a path's scale besides what the solve knows of: paths have errors of their own shape
    (see docs/measurements/world.md)."""
    iterations: int = 12
    converged_m: float = 3e-4
    """Nobody moves further in the last step, metres: what is left to go is below a millimetre."""


@dataclass(frozen=True)
class Solution:
    """The world after the solve."""

    pelvis: tuple[Float[Array, "n 3"], ...]
    """Per trajectory, metres."""
    contacts: tuple[Float[Array, "n 4"], ...]
    """Per trajectory: how surely each sole point stands still on the floor, 0..1."""
    rotation: Float[Array, "shots 3 3"]
    """Small rotation of each shot: multiply world rotations and offsets of the shot from the left."""
    origin: Float[Array, "shots 3"]
    """Position of the shot's origin, metres."""
    scale: Float[Array, "shots"]
    log_scale_std: Float[Array, "shots"]
    """Standard deviation of the logarithm of the scale of a path that was not known, against the people's size."""
    from_floor: Bool[Array, "shots"]
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
    state = _State(
        [s.offset.copy() for s in trajectories],
        np.tile(np.eye(3), (shots, 1, 1)),
        np.zeros((shots, 3)),
        scale,
        np.zeros(len(_people(trajectories))),
        0.0,
    )
    # The first steps join the shots by inertia alone; then feet that stand still count; then the floor.
    for iteration in range(settings.iterations):
        if iteration == _FLOOR_FROM:
            state = _put_on_floor(trajectories, rigs, state, settings)
        before = state
        state, equations = _step(trajectories, rigs, floors, edges, same, state, settings, iteration, focal_std)
        moved = max((float(np.abs(a - b).max()) for a, b in zip(state.pelvis, before.pelvis, strict=True)), default=0.0)
        if iteration > _FLOOR_FROM and moved < settings.converged_m:
            break
    contacts = tuple(
        _hold(trajectory, rigs[trajectory.shot], state, k, settings)[1] for k, trajectory in enumerate(trajectories)
    )
    return Solution(
        pelvis=tuple(state.pelvis),
        contacts=contacts,
        rotation=state.rotation,
        origin=state.origin,
        scale=state.scale,
        log_scale_std=np.hypot(
            equations.std(np.array([equations.camera(shot)[SCALE] for shot in range(shots)])) / state.scale,
            settings.log_scale_std,
        ),
        from_floor=np.array([floor is not None for floor in floors]),
        size=dict(zip(_people(trajectories), np.exp(state.log_size).tolist(), strict=True)),
        focal=float(np.exp(state.log_focal)),
    )


_STILL_FROM, _FLOOR_FROM, _FREE_FROM = 1, 4, 4
"""Steps from which feet that stand still count, the floor counts, and shots may turn and the focal length change."""
_DAMPING = 1e-6


@dataclass(frozen=True)
class _State:
    pelvis: list[Array]
    rotation: Array
    origin: Array
    scale: Array
    log_size: Array
    """Per person, in order of their numbers: logarithm of how much larger he is than `ShotTrajectory` has him."""
    log_focal: float
    """Logarithm of how much longer the focal length is than that of `ShotTrajectory`."""

    def ordered(self, order: Sequence[int]) -> "_State":
        """The same with the trajectories in another order."""
        return replace(self, pelvis=[self.pelvis[k] for k in order])


def _people(trajectories: Sequence[ShotTrajectory]) -> list[int]:
    """Everybody's number, in order."""
    return sorted({trajectory.person for trajectory in trajectories})


def _step(
    trajectories: Sequence[ShotTrajectory],
    rigs: Sequence[ShotRig],
    floors: Sequence[LogScale | None],
    edges: Sequence[CameraEdge],
    same: Sequence[SameCamera],
    state: _State,
    settings: SolveSettings,
    iteration: int,
    focal_std: float,
) -> tuple[_State, WorldEquations]:
    """The state after one Gauss-Newton step, and the equations that gave it."""
    order = sorted(range(len(trajectories)), key=lambda k: (trajectories[k].person, int(trajectories[k].frame[0])))
    equations = _of_people([trajectories[k] for k in order], rigs, state.ordered(order), settings, iteration)
    _levels(equations, rigs, edges, state, settings)
    _scales(equations, floors, state, settings)
    _same_cameras(equations, rigs, same, state)
    if focal_std > 0:
        equations.add_shared(np.array([state.log_focal / focal_std]), (equations.focal, np.array([[1 / focal_std]])))

    damping = np.full(len(equations.shared_gradient), _DAMPING)
    of_cameras = damping[: CAMERA_UNKNOWNS * len(rigs)].reshape(-1, CAMERA_UNKNOWNS)
    of_cameras[0, :2] = 1e6  # the first camera stays where it is, but for its height
    if iteration < _FLOOR_FROM:
        of_cameras[0, 2] = 1e6
    of_cameras[0, 5] = 1e8  # nor does it turn
    if iteration < _FREE_FROM:
        of_cameras[:, 3:6] = 1e8
    if iteration < _FREE_FROM or focal_std <= 0:
        damping[equations.focal] = 1e8
    known = np.array([rig.scale_known or not np.any(rig.path) for rig in rigs])
    of_cameras[known, SCALE] = 1e8
    steps, shared = equations.step(_DAMPING, damping)
    moved = shared[: of_cameras.size].reshape(-1, CAMERA_UNKNOWNS)
    pelvis = list(state.pelvis)
    for k, segment in zip(order, equations.segments, strict=True):
        pelvis[k] = pelvis[k] + steps[segment.start : segment.stop]
    after = _State(
        pelvis=pelvis,
        rotation=rotvec_to_rotmat(moved[:, 3:6]) @ state.rotation,
        origin=state.origin + moved[:, :3],
        # A scale neither changes sign nor runs away in one step.
        scale=np.clip(state.scale + moved[:, SCALE], 0.3 * state.scale, 3.0 * state.scale),
        log_size=state.log_size + shared[of_cameras.size : -1],
        log_focal=state.log_focal + float(shared[-1]),
    )
    return after, equations


def _of_people(
    trajectories: Sequence[ShotTrajectory],
    rigs: Sequence[ShotRig],
    state: _State,
    settings: SolveSettings,
    iteration: int,
) -> WorldEquations:
    """The equations with all that is known of people. `trajectories`: by person, then by time."""
    people = _people(trajectories)
    of_person = [people.index(trajectory.person) for trajectory in trajectories]
    segments = segments_of(of_person, [one.shot for one in trajectories], [one.time_s for one in trajectories])
    equations = WorldEquations(segments, len(rigs))
    for k, trajectory in enumerate(trajectories):
        sized = trajectory.seen_through(state.log_focal)
        sized = replace(sized, offset=np.exp(state.log_size[of_person[k]]) * sized.offset)
        _observations(equations, sized, rigs[sized.shot], state, k, settings, robust=iteration > 0)
        if iteration >= _STILL_FROM:
            _feet(equations, sized, rigs[sized.shot], state, k, settings, floor=iteration >= _FLOOR_FROM)
    for person in range(len(people)):
        own = [k for k, owner in enumerate(of_person) if owner == person]
        time_s = np.concatenate([trajectories[k].time_s for k in own])
        _inertia(equations, np.concatenate([state.pelvis[k] for k in own]), time_s, segments[own[0]].start, settings)
    known = {trajectory.person for trajectory in trajectories if trajectory.size_known}
    _sizes(equations, state, [person in known for person in people], settings)
    return equations


def _observations(
    equations: WorldEquations,
    trajectory: ShotTrajectory,
    rig: ShotRig,
    state: _State,
    index: int,
    settings: SolveSettings,
    *,
    robust: bool,
) -> None:
    """The person is where the picture shows, loosely along the line of sight."""
    T = state.rotation[trajectory.shot]
    path = rig.path[trajectory.frame - rig.start] @ T.T
    offset = trajectory.offset @ T.T
    arm = state.scale[trajectory.shot] * path + offset
    error = state.pelvis[index] - state.origin[trajectory.shot] - arm
    distance = np.linalg.norm(offset, axis=1)
    sight = (offset / distance[:, None])[:, :, None]
    outer = sight @ sight.transpose(0, 2, 1)
    correlated = max(1.0, settings.correlation_s / trajectory.step_s)
    trust = np.sqrt(np.maximum(trajectory.weight, 0.05) / correlated)[:, None, None]
    along = settings.depth_fraction * distance[:, None, None]
    whiten = trust * ((np.eye(3) - outer) / settings.across_m + outer / along)
    residual = np.einsum("nab,nb->na", whiten, error)
    if robust:
        size = np.linalg.norm(residual, axis=1) * np.sqrt(correlated)
        factor = np.sqrt(huber_weight(size, 2.0))[:, None]
        residual, whiten = residual * factor, whiten * factor[..., None]
    ahead = trajectory.ahead @ T.T
    deeper = np.sum(offset * ahead, axis=1, keepdims=True) * ahead
    by_shared = [-whiten, whiten @ skew(arm), *(-whiten @ one[..., None] for one in (path, offset, deeper))]
    equations.add_positions(index, residual, whiten, np.concatenate(by_shared, axis=-1))


def _hold(
    trajectory: ShotTrajectory, rig: ShotRig, state: _State, index: int, settings: SolveSettings
) -> tuple[Float[Array, "n-1 4"], Float[Array, "n 4"], Float[Array, "n-1 3 3"]]:
    """How surely each sole point stands still between frames, how surely it stands on the floor in each frame, and
    what whitens the velocity of one that stands still."""
    feet = trajectory.feet @ state.rotation[trajectory.shot].T + state.pelvis[index][:, None]
    step = np.diff(trajectory.time_s)[:, None]
    sight = unit(trajectory.offset[:-1] @ state.rotation[trajectory.shot].T)
    coming = _coming(trajectory, rig, float(state.scale[trajectory.shot]))
    along_ms = np.hypot(settings.still_along_ms, settings.swing_fraction * coming)[:, None, None]
    along = sight[:, :, None] @ sight[:, None]
    whiten = (np.eye(3) - along) / settings.still_ms + along / along_ms
    speed = np.linalg.norm(np.einsum("nab,nkb->nka", whiten, np.diff(feet, axis=0)), axis=-1) / step
    # Over a hole in the track nothing is held.
    still = 1 / (1 + (speed / settings.moving) ** 2) ** 2 * (step < _HOLE_S)
    in_frame = np.zeros((len(feet), 4))
    if len(feet) > 1:
        in_frame[:-1] = still
        in_frame[1:] = np.maximum(in_frame[1:], still)
    on_floor = in_frame / (1 + (feet[..., 2] / settings.floor_m) ** 2) ** 2
    return still, on_floor, whiten


_HOLE_S = 0.1


def _coming(trajectory: ShotTrajectory, rig: ShotRig, scale: float) -> Float[Array, "n-1"]:
    """Speed along the line of sight at which the pictures show somebody come or go, m/s; fitted distances tremble, so
    that it is a mean over some frames."""
    seen = scale * rig.path[trajectory.frame - rig.start] + trajectory.offset
    velocity = np.diff(seen, axis=0) / np.diff(trajectory.time_s)[:, None]
    frames = _COMING_S / trajectory.step_s
    return np.asarray(
        np.abs(np.sum(gaussian_filter1d(velocity, frames, axis=0) * unit(trajectory.offset[:-1]), axis=-1))
    )


_COMING_S = 0.15


def _feet(
    equations: WorldEquations,
    trajectory: ShotTrajectory,
    rig: ShotRig,
    state: _State,
    index: int,
    settings: SolveSettings,
    *,
    floor: bool,
) -> None:
    """Planted feet keep their position, those that bear the body are on the floor, none is below it."""
    if len(trajectory.frame) < 2:
        return
    rotated = trajectory.feet @ state.rotation[trajectory.shot].T
    pair = rotated + state.pelvis[index][:, None]
    still, on_floor, whiten = _hold(trajectory, rig, state, index, settings)
    correlated = np.sqrt(max(1.0, settings.correlation_s / trajectory.step_s))
    step = np.diff(trajectory.time_s)[:, None]
    weight = np.sqrt(still) / step / np.sqrt(correlated)
    moved, swing = np.diff(pair, axis=0), np.diff(rotated, axis=0)
    by_shared = np.zeros((*swing.shape, SHARED_UNKNOWNS))
    by_shared[..., 3:6] = -skew(swing)
    equations.add_still(index, weight[..., None, None] * whiten[:, None], moved, by_shared)
    if not floor:
        return
    below = pair[..., 2] < 0
    bearing = np.sqrt(np.where(below, np.maximum(on_floor, 0.5), on_floor)) / settings.floor_m / correlated
    by_position, by_shared = np.zeros((*bearing.shape, 3)), np.zeros((*bearing.shape, SHARED_UNKNOWNS))
    by_position[..., 2] = bearing
    by_shared[..., 3:6] = bearing[..., None] * -skew(rotated)[..., 2, :]
    equations.add_positions(index, bearing * pair[..., 2], by_position, by_shared)


def _sizes(equations: WorldEquations, state: _State, known: Sequence[bool], settings: SolveSettings) -> None:
    """People differ in size, but by what factor all of them do no picture says, unless somebody's height is known."""
    if not known:
        return
    size = state.log_size
    sigma = np.where(known, settings.known_size_std, np.where(size > 0, settings.taller_std, settings.smaller_std))
    # Evidence that asks for more than twice that is rather wrong: the cost grows with the sixth power.
    steep = (size / (2 * sigma)) ** 2
    residual, rows = size / sigma * (1 + steep), np.diag((1 + 3 * steep) / sigma)
    if not any(known):
        mean = np.full(len(known), 1 / (len(known) * settings.known_size_std))
        residual, rows = np.append(residual, mean @ size), np.vstack([rows, mean])
    people = np.concatenate([equations.size(person) for person in range(len(known))])
    equations.add_shared(residual, (people, rows))


def _inertia(
    equations: WorldEquations,
    pelvis: Float[Array, "n 3"],
    time_s: Float[Array, "n"],
    first: int,
    settings: SolveSettings,
) -> None:
    """Velocity changes slowly, across cuts as well; over a hole it may have changed more."""
    if len(pelvis) < 2:
        return
    step = np.diff(time_s)
    velocity = np.diff(pelvis, axis=0) / step[:, None]
    # Where acceleration says nothing (two frames, a long hole) the speed is at least one that a person can have.
    loose = np.flatnonzero(step > _HOLE_S) if len(pelvis) > 2 else np.arange(len(step))
    slope = 1 / (_PERSON_SPEED_MS * step[loose])
    equations.add_chain(first + loose, np.stack([-slope, slope], axis=1), velocity[loose] / _PERSON_SPEED_MS)
    if len(pelvis) < 3:
        return
    middle = 0.5 * (step[1:] + step[:-1])
    sigma = settings.acceleration_ms2 * middle / np.sqrt(1 + middle / _ACCELERATION_S)
    after, before = 1 / (step[1:] * sigma), 1 / (step[:-1] * sigma)
    coefficients = np.stack([before, -(after + before), after], axis=1)
    equations.add_chain(first + np.arange(len(coefficients)), coefficients, np.diff(velocity, axis=0) / sigma[:, None])


_PERSON_SPEED_MS = 3.0
_ACCELERATION_S = 0.3
"""A push lasts about so long: over longer times velocity changes like a random walk."""


def _levels(
    equations: WorldEquations,
    rigs: Sequence[ShotRig],
    edges: Sequence[CameraEdge],
    state: _State,
    settings: SolveSettings,
) -> None:
    """Every shot stays about as level as it came, neighbouring shots rotated against each other as their edge says."""
    of_rotation, rotated = np.eye(CAMERA_UNKNOWNS)[3:6], rotmat_to_rotvec(state.rotation)
    for shot, rig in enumerate(rigs):
        tilt_deg = min(rig.level_deg, settings.level_deg)
        w_axes = 1 / np.deg2rad([tilt_deg, tilt_deg, settings.level_deg / settings.heading_trust])
        equations.add_shared(w_axes * rotated[shot], (equations.camera(shot), w_axes[:, None] * of_rotation))
    for edge in edges:
        w_axes = np.array([1.0, 1.0, settings.heading_trust]) / np.deg2rad(edge.sigma_deg)
        difference, by_b = rotated[edge.b] - rotated[edge.a], w_axes[:, None] * of_rotation
        equations.add_shared(w_axes * difference, (equations.camera(edge.b), by_b), (equations.camera(edge.a), -by_b))


def _scales(
    equations: WorldEquations, floors: Sequence[LogScale | None], state: _State, settings: SolveSettings
) -> None:
    """The scale of a camera's path is about what the floor says."""
    of_scale = np.eye(CAMERA_UNKNOWNS)[SCALE:]
    for shot, floor in enumerate(floors):
        if floor is None:
            continue
        off = (np.log(state.scale[shot]) - floor.mean) / floor.sigma
        w = np.sqrt(cauchy_weight(np.square(off / settings.floor_scale_reach)))
        by_scale = w / (floor.sigma * state.scale[shot]) * of_scale
        equations.add_shared(np.array([w * off]), (equations.camera(shot), by_scale))


def _same_cameras(
    equations: WorldEquations, rigs: Sequence[ShotRig], same: Sequence[SameCamera], state: _State
) -> None:
    """A static camera that returns is where it was."""
    w = 1 / _SAME_CAMERA_M
    for pair in same:
        difference, blocks = np.zeros(3), []
        for shot, frame, sign in ((pair.shot_a, pair.frame_a, 1.0), (pair.shot_b, pair.frame_b, -1.0)):
            arm = state.scale[shot] * rigs[shot].path[frame - rigs[shot].start] @ state.rotation[shot].T
            difference = difference + sign * (state.origin[shot] + arm)
            by_camera = np.concatenate([np.eye(3), -skew(arm), np.zeros((3, 1))], axis=1)
            blocks.append((equations.camera(shot), sign * w * by_camera))
        equations.add_shared(w * difference, *blocks)


_SAME_CAMERA_M = 0.02


def _put_on_floor(
    trajectories: Sequence[ShotTrajectory], rigs: Sequence[ShotRig], state: _State, settings: SolveSettings
) -> _State:
    """Every shot raised or lowered so that its lowest standing feet are at z = 0."""
    shift = np.zeros(len(state.origin))
    for shot in range(len(shift)):
        heights, weights = [], []
        for k, trajectory in enumerate(trajectories):
            if trajectory.shot == shot:
                feet = trajectory.feet @ state.rotation[shot].T + state.pelvis[k][:, None]
                lowest = feet[..., 2].min(axis=1)
                still = _hold(trajectory, rigs[trajectory.shot], state, k, settings)[0].max(axis=1, initial=0.0)
                heights.append(lowest)
                weights.append(np.concatenate([still, still[-1:]]) if len(still) else np.ones(1))
        if heights:
            height, weight = np.concatenate(heights), np.concatenate(weights)
            grounded = height[weight > 0.5] if (weight > 0.5).sum() >= 3 else height
            shift[shot] = np.percentile(grounded, LOWEST_PERCENT)
    drop = shift[:, None] * np.array([0.0, 0.0, 1.0])
    return replace(
        state,
        pelvis=[p - drop[trajectory.shot] for trajectory, p in zip(trajectories, state.pelvis, strict=True)],
        origin=state.origin - drop,
    )
