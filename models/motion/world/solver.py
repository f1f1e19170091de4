"""Where everybody and every camera stands: one sparse least squares over the whole video.

The rotations are known up to a few degrees (from the cuts), each person's place in front of the camera up to its
depth, and the path of a moving camera up to its scale. What ties them together:

- the person stands where the picture shows: tightly across the line of sight, loosely along it;
- a foot that stands still stands still, and one that bears the body is on the floor, z = 0;
- bodies have inertia, also across a cut: that joins the shots;
- every shot is about as level as its people and its camera say, and turned to the others as the cuts say.

Unknown are the pelvis of every person in every frame, and for each shot the camera's place, a small rotation and the
scale of its path. All of it is linear but for the small rotations and the robust weights: a few Gauss-Newton steps.
Time and memory grow linearly with the video.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from humanmm.models.geometry.robust import huber_weight
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat, skew
from humanmm.models.motion.world.equations import CAMERA_UNKNOWNS, WorldEquations, links_of

Array = np.ndarray


@dataclass(frozen=True)
class Strand:
    """One person in one shot: n observed frames. World axes already, up to the small rotations to be found."""

    person: int
    shot: int
    frame: Int[Array, "n"]
    time_s: Float[Array, "n"]
    offset: Float[Array, "n 3"]
    """Pelvis from the camera's centre, metres, world axes."""
    feet: Float[Array, "n 4 3"]
    """Sole points (left heel, left toes, right heel, right toes) from the pelvis, metres, world axes."""
    weight: Float[Array, "n"]
    """Trust in the observation, 0..1."""


@dataclass(frozen=True)
class ShotRig:
    """One shot's camera in world axes."""

    path: Float[Array, "F 3"]
    """Camera centre of each frame from the shot's origin, world axes, in the camera's own unit."""
    start: int
    scale: float
    """Metres per unit of `path`."""
    scale_known: bool


@dataclass(frozen=True)
class Join:
    """Two shots whose relative rotation is known from a cut."""

    shot_a: int
    shot_b: int
    sigma_deg: float


@dataclass(frozen=True)
class SamePlace:
    """Two frames of different shots taken by one standing camera."""

    shot_a: int
    frame_a: int
    shot_b: int
    frame_b: int


@dataclass(frozen=True)
class SolveSettings:
    """Sigmas of what ties the world together, as measured on fits to rendered people."""

    across_m: float = 0.02
    """Error of the pelvis across the line of sight."""
    depth_share: float = 0.02
    """Error of the pelvis along the line of sight that changes within a shot, share of the distance."""
    correlation_s: float = 0.4
    """Errors of observations change this slowly."""
    still_ms: float = 0.3
    """Speed of a foot that stands still, with the noise of the fitted leg."""
    moving_ms: float = 0.5
    """A foot this fast certainly moves."""
    floor_m: float = 0.1
    """Height of a sole point that bears the body; the four points of a body err together."""
    acceleration_ms2: float = 6.0
    level_deg: float = 4.0
    """Error of a shot's vertical before the solve."""
    iterations: int = 12


@dataclass(frozen=True)
class Solution:
    """The world after the solve."""

    pelvis: tuple[Float[Array, "n 3"], ...]
    """Per strand, metres."""
    contacts: tuple[Float[Array, "n 4"], ...]
    """Per strand: how surely each sole point stands still on the floor, 0..1."""
    turn: Float[Array, "shots 3 3"]
    """Small rotation of each shot: multiply world rotations and offsets of the shot from the left."""
    origin: Float[Array, "shots 3"]
    """Place of the shot's origin, metres."""
    scale: Float[Array, "shots"]


def solve(
    strands: Sequence[Strand],
    rigs: Sequence[ShotRig],
    joins: Sequence[Join],
    same: Sequence[SamePlace] = (),
    settings: SolveSettings | None = None,
) -> Solution:
    """Positions of people and cameras, the scale of each camera's path and small corrections of each shot's
    rotation."""
    options = settings or SolveSettings()
    shots = len(rigs)
    scale = np.array([r.scale if r.scale_known else start_scale(r, k, strands) for k, r in enumerate(rigs)])
    state = _State([s.offset.copy() for s in strands], np.tile(np.eye(3), (shots, 1, 1)), np.zeros((shots, 3)), scale)
    # The first steps join the shots by inertia alone; then feet that stand still count; then the floor.
    for iteration in range(options.iterations):
        if iteration == _FLOOR_FROM:
            state = _put_on_floor(strands, state, options)
        state = _step(strands, rigs, joins, same, state, options, iteration)
    contacts = tuple(_hold(strand, state, k, options)[1] for k, strand in enumerate(strands))
    return Solution(tuple(state.pelvis), contacts, state.turn, state.origin, state.scale)


_STILL_FROM, _FLOOR_FROM, _TURN_FROM = 1, 4, 4
_DAMPING = 1e-6


@dataclass(frozen=True)
class _State:
    pelvis: list[Array]
    turn: Array
    origin: Array
    scale: Array


def _step(
    strands: Sequence[Strand],
    rigs: Sequence[ShotRig],
    joins: Sequence[Join],
    same: Sequence[SamePlace],
    state: _State,
    options: SolveSettings,
    iteration: int,
) -> _State:
    order = sorted(range(len(strands)), key=lambda k: (strands[k].person, int(strands[k].frame[0])))
    links = links_of(
        [strands[k].person for k in order], [strands[k].shot for k in order], [strands[k].time_s for k in order]
    )
    equations = WorldEquations(links, len(rigs))
    for k, link in zip(order, links, strict=True):
        strand = strands[k]
        _observations(equations, strand, rigs[strand.shot], state, k, link.start, options, robust=iteration > 0)
        if iteration >= _STILL_FROM:
            _feet(equations, strand, state, k, link.start, options, floor=iteration >= _FLOOR_FROM)
    for person in sorted({strand.person for strand in strands}):
        own = [(k, link) for k, link in zip(order, links, strict=True) if strands[k].person == person]
        time_s = np.concatenate([strands[k].time_s for k, _ in own])
        _inertia(equations, np.concatenate([state.pelvis[k] for k, _ in own]), time_s, own[0][1].start, options)
    _levels(equations, joins, state, options)
    _same_places(equations, rigs, same, state)

    damping = np.full((len(rigs), CAMERA_UNKNOWNS), _DAMPING)
    damping[0, :2] = 1e6  # the first camera stays where it is, but for its height
    if iteration < _FLOOR_FROM:
        damping[0, 2] = 1e6
    damping[:, 5] = 1e8  # headings are the cuts' business: feet and inertia level a shot but do not turn it
    if iteration < _TURN_FROM:
        damping[:, 3:6] = 1e8
    known = np.array([rig.scale_known or not np.any(rig.path) for rig in rigs])
    damping[known, 6] = 1e8
    places, moved = equations.step(_DAMPING, damping)
    start = {k: link.start for k, link in zip(order, links, strict=True)}
    # A scale neither changes sign nor runs away in one step.
    scale = np.clip(state.scale + moved[:, 6], 0.3 * state.scale, 3.0 * state.scale)
    return _State(
        pelvis=[state.pelvis[k] + places[start[k] : start[k] + len(state.pelvis[k])] for k in range(len(strands))],
        turn=rotvec_to_rotmat(moved[:, 3:6]) @ state.turn,
        origin=state.origin + moved[:, :3],
        scale=scale,
    )


def _observations(
    equations: WorldEquations,
    strand: Strand,
    rig: ShotRig,
    state: _State,
    index: int,
    first: int,
    options: SolveSettings,
    *,
    robust: bool,
) -> None:
    """The person stands where the picture shows, loosely along the line of sight."""
    T = state.turn[strand.shot]
    path, offset = rig.path[strand.frame - rig.start] @ T.T, strand.offset @ T.T
    arm = state.scale[strand.shot] * path + offset
    error = state.pelvis[index] - state.origin[strand.shot] - arm
    distance = np.linalg.norm(offset, axis=1)
    sight = (offset / distance[:, None])[:, :, None]
    outer = sight @ sight.transpose(0, 2, 1)
    correlated = max(1.0, options.correlation_s / _frame_step(strand.time_s))
    trust = np.sqrt(np.maximum(strand.weight, 0.05) / correlated)[:, None, None]
    along = options.depth_share * distance[:, None, None]
    whiten = trust * ((np.eye(3) - outer) / options.across_m + outer / along)
    residual = np.einsum("nab,nb->na", whiten, error)
    if robust:
        size = np.linalg.norm(residual, axis=1) * np.sqrt(correlated)
        factor = np.sqrt(huber_weight(size, 2.0))[:, None]
        residual, whiten = residual * factor, whiten * factor[..., None]
    by_camera = np.concatenate([-whiten, whiten @ skew(arm), -whiten @ path[..., None]], axis=-1)
    equations.add_places(first, strand.shot, residual, whiten, by_camera)


def _hold(
    strand: Strand, state: _State, index: int, options: SolveSettings
) -> tuple[Float[Array, "n-1 4"], Float[Array, "n 4"]]:
    """How surely each sole point stands still between frames, and how surely it stands on the floor in each frame."""
    feet = strand.feet @ state.turn[strand.shot].T + state.pelvis[index][:, None]
    step = np.diff(strand.time_s)[:, None]
    speed = np.linalg.norm(np.diff(feet, axis=0), axis=-1) / step
    # Over a hole in the track nothing is held.
    still = 1 / (1 + (speed / options.moving_ms) ** 2) ** 2 * (step < _HOLE_S)
    in_frame = np.zeros((len(feet), 4))
    if len(feet) > 1:
        in_frame[:-1] = still
        in_frame[1:] = np.maximum(in_frame[1:], still)
    on_floor = in_frame / (1 + (feet[..., 2] / options.floor_m) ** 2) ** 2
    return still, on_floor


_HOLE_S = 0.1


def _feet(
    equations: WorldEquations,
    strand: Strand,
    state: _State,
    index: int,
    first: int,
    options: SolveSettings,
    *,
    floor: bool,
) -> None:
    """Feet that stand still keep their place, those that bear the body are on the floor, none is below it."""
    if len(strand.frame) < 2:
        return
    turned = strand.feet @ state.turn[strand.shot].T
    place = turned + state.pelvis[index][:, None]
    still, on_floor = _hold(strand, state, index, options)
    correlated = np.sqrt(max(1.0, options.correlation_s / _frame_step(strand.time_s)))
    step = np.diff(strand.time_s)[:, None]
    weight = np.sqrt(still) / (options.still_ms * step) / np.sqrt(correlated)
    moved, swing = np.diff(place, axis=0), np.diff(turned, axis=0)
    for foot in range(4):
        equations.add_still(first, strand.shot, weight[:, foot], moved[:, foot], -skew(swing[:, foot]))
    if not floor:
        return
    below = place[..., 2] < 0
    bearing = np.sqrt(np.where(below, np.maximum(on_floor, 0.5), on_floor)) / options.floor_m / correlated
    by_place, by_camera = np.zeros((*bearing.shape, 3)), np.zeros((*bearing.shape, CAMERA_UNKNOWNS))
    by_place[..., 2] = bearing
    by_camera[..., 3:6] = bearing[..., None] * -skew(turned)[..., 2, :]
    equations.add_places(first, strand.shot, bearing * place[..., 2], by_place, by_camera)


def _inertia(
    equations: WorldEquations,
    pelvis: Float[Array, "n 3"],
    time_s: Float[Array, "n"],
    first: int,
    options: SolveSettings,
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
    sigma = options.acceleration_ms2 * middle / np.sqrt(1 + middle / _ACCELERATION_S)
    after, before = 1 / (step[1:] * sigma), 1 / (step[:-1] * sigma)
    shares = np.stack([before, -(after + before), after], axis=1)
    equations.add_chain(first + np.arange(len(shares)), shares, np.diff(velocity, axis=0) / sigma[:, None])


_PERSON_SPEED_MS = 3.0
_ACCELERATION_S = 0.3
"""A push lasts about so long: over longer times velocity changes like a random walk."""


def _levels(equations: WorldEquations, joins: Sequence[Join], state: _State, options: SolveSettings) -> None:
    """Every shot stays about as level as it came, neighbouring shots turned to each other as their link says."""
    turning = np.eye(CAMERA_UNKNOWNS)[3:6]
    for shot, turn in enumerate(state.turn):
        w = 1 / np.deg2rad(options.level_deg)
        equations.add_cameras(w * rotmat_to_rotvec(turn), (shot, w * turning))
    for join in joins:
        w = 1 / np.deg2rad(join.sigma_deg)
        difference = rotmat_to_rotvec(state.turn[join.shot_b]) - rotmat_to_rotvec(state.turn[join.shot_a])
        equations.add_cameras(w * difference, (join.shot_b, w * turning), (join.shot_a, -w * turning))


def _same_places(equations: WorldEquations, rigs: Sequence[ShotRig], same: Sequence[SamePlace], state: _State) -> None:
    """A standing camera that returns stands where it stood."""
    w = 1 / _SAME_PLACE_M
    for place in same:
        difference, blocks = np.zeros(3), []
        for shot, frame, sign in ((place.shot_a, place.frame_a, 1.0), (place.shot_b, place.frame_b, -1.0)):
            arm = state.scale[shot] * rigs[shot].path[frame - rigs[shot].start] @ state.turn[shot].T
            difference = difference + sign * (state.origin[shot] + arm)
            by_camera = np.concatenate([np.eye(3), -skew(arm), np.zeros((3, 1))], axis=1)
            blocks.append((shot, sign * w * by_camera))
        equations.add_cameras(w * difference, *blocks)


_SAME_PLACE_M = 0.02


def _put_on_floor(strands: Sequence[Strand], state: _State, options: SolveSettings) -> _State:
    """Every shot raised or lowered so that its lowest standing feet are at z = 0."""
    shift = np.zeros(len(state.origin))
    for shot in range(len(shift)):
        heights, weights = [], []
        for k, strand in enumerate(strands):
            if strand.shot == shot:
                feet = strand.feet @ state.turn[shot].T + state.pelvis[k][:, None]
                lowest = feet[..., 2].min(axis=1)
                still = _hold(strand, state, k, options)[0].max(axis=1, initial=0.0)
                heights.append(lowest)
                weights.append(np.concatenate([still, still[-1:]]) if len(still) else np.ones(1))
        if heights:
            height, weight = np.concatenate(heights), np.concatenate(weights)
            grounded = height[weight > 0.5] if (weight > 0.5).sum() >= 3 else height
            shift[shot] = np.percentile(grounded, 15)
    drop = shift[:, None] * np.array([0.0, 0.0, 1.0])
    return replace(
        state,
        pelvis=[p - drop[strand.shot] for strand, p in zip(strands, state.pelvis, strict=True)],
        origin=state.origin - drop,
    )


_SCALE_SAMPLES = 500
"""Pairs of frames of a person that are enough to tell a scale."""


def start_scale(rig: ShotRig, shot: int, strands: Sequence[Strand]) -> float:
    """Metres per unit of a moving camera's path under which somebody's slower foot stands still most of the time.

    Only the motion across the line of sight is asked, where depth errors do not reach.
    """
    costs, unit = [], 0.0
    candidates = np.zeros(0)
    velocity_path = np.diff(rig.path, axis=0)
    for strand in strands:
        own = np.flatnonzero(np.diff(strand.frame) == 1)
        own = own[:: max(1, len(own) // _SCALE_SAMPLES)]
        if strand.shot != shot or len(own) < 2:
            continue
        step = np.diff(strand.time_s)[own, None]
        camera = velocity_path[strand.frame[own] - rig.start] / step
        unit = max(unit, float(np.median(np.linalg.norm(camera, axis=1))))
        if not len(candidates):
            if unit <= 0:
                return 1.0
            candidates = np.geomspace(0.02, 8.0, 60) / unit
        feet = strand.offset[:, None] + strand.feet
        velocity = np.diff(feet, axis=0)[own] / step[..., None]
        sight = strand.offset[own] / np.linalg.norm(strand.offset[own], axis=1, keepdims=True)
        total = velocity[None] + candidates[:, None, None, None] * camera[None, :, None]
        across = total - (total * sight[None, :, None]).sum(-1, keepdims=True) * sight[None, :, None]
        slowest = np.linalg.norm(across, axis=-1).min(axis=2)
        costs.append((slowest / (slowest + 0.3)).mean(axis=1))
    if not costs:
        return 1.0
    return float(candidates[int(np.sum(costs, axis=0).argmin())])


def _frame_step(time_s: Float[Array, "n"]) -> float:
    return float(np.median(np.diff(time_s))) if len(time_s) > 1 else 1.0
