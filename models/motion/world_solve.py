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
from scipy import sparse
from scipy.sparse.linalg import splu

from humanmm.models.rotations import rotation_from_vector, skew, vector_from_rotation

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


CAMERA_UNKNOWNS = 7
"""Per shot: place (3), small rotation (3), scale (1)."""


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


@dataclass(frozen=True)
class _State:
    pelvis: list[Array]
    turn: Array
    origin: Array
    scale: Array


_PARTS = 24
"""So many terms are kept apart before they are summed: summing each at once takes time, all at the end memory."""


class _Rows:
    """Normal equations of whitened residuals, gathered from sparse groups of rows."""

    def __init__(self, num_unknowns: int) -> None:
        self.num_unknowns = num_unknowns
        self._parts: list[sparse.coo_matrix] = []
        self._gradient = np.zeros(num_unknowns)

    def add(self, residual: Float[Array, "n m"], *blocks: tuple[Int[Array, "n"], Float[Array, "n m b"]]) -> None:
        """n groups of m residuals; each block gives the first unknown of every group and the derivatives by b of
        them."""
        n, m = residual.shape
        rows = np.arange(n * m).reshape(n, m)
        row, column, value = [], [], []
        for first, derivative in blocks:
            shape = (n, m, derivative.shape[2])
            row.append(np.broadcast_to(rows[:, :, None], shape).ravel())
            column.append(np.broadcast_to(first[:, None, None] + np.arange(shape[2]), shape).ravel())
            value.append(np.broadcast_to(derivative, shape).ravel())
        J = sparse.csr_matrix(
            (np.concatenate(value), (np.concatenate(row), np.concatenate(column))), shape=(n * m, self.num_unknowns)
        )
        self._parts.append((J.T @ J).tocoo())
        if len(self._parts) > _PARTS:
            self._parts = [self._summed(self._parts).tocoo()]
        self._gradient += J.T @ residual.ravel()

    def _summed(self, parts: Sequence[sparse.coo_matrix]) -> sparse.csc_matrix:
        row, column, value = (
            np.concatenate([getattr(part, name) for part in parts]) for name in ("row", "col", "data")
        )
        return sparse.csc_matrix((value, (row, column)), shape=(self.num_unknowns, self.num_unknowns))

    def step(self, damping: Float[Array, "unknowns"]) -> Float[Array, "unknowns"]:
        """Gauss-Newton step, damped by a diagonal."""
        normal = self._summed([*self._parts, sparse.diags(damping).tocoo()])
        # The ordering for symmetric matrices keeps the factor as sparse as the chain of frames is.
        factor = splu(normal, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        return np.asarray(-factor.solve(self._gradient))


def _step(
    strands: Sequence[Strand],
    rigs: Sequence[ShotRig],
    joins: Sequence[Join],
    same: Sequence[SamePlace],
    state: _State,
    options: SolveSettings,
    iteration: int,
) -> _State:
    counts = [len(strand.frame) for strand in strands]
    firsts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64) * 3
    cameras = int(firsts[-1])
    rows = _Rows(cameras + CAMERA_UNKNOWNS * len(rigs))
    for k, strand in enumerate(strands):
        pelvis = firsts[k] + 3 * np.arange(counts[k])
        camera = cameras + CAMERA_UNKNOWNS * strand.shot
        _observations(rows, strand, rigs[strand.shot], state, k, pelvis, camera, options, robust=iteration > 0)
        if iteration >= _STILL_FROM:
            _feet(rows, strand, state, k, pelvis, camera, options, floor=iteration >= _FLOOR_FROM)
    for person in sorted({strand.person for strand in strands}):
        own = [k for k, strand in enumerate(strands) if strand.person == person]
        own.sort(key=lambda k: int(strands[k].frame[0]))
        unknown = np.concatenate([firsts[k] + 3 * np.arange(counts[k]) for k in own])
        time_s = np.concatenate([strands[k].time_s for k in own])
        _inertia(rows, np.concatenate([state.pelvis[k] for k in own]), time_s, unknown, options)
    _levels(rows, joins, state, cameras, options)
    _same_places(rows, rigs, same, state, cameras)

    damping = np.full(rows.num_unknowns, 1e-6)
    block = damping[cameras:].reshape(len(rigs), CAMERA_UNKNOWNS)
    block[0, :2] = 1e6  # the first camera stays where it is, but for its height
    if iteration < _FLOOR_FROM:
        block[0, 2] = 1e6
    block[:, 5] = 1e8  # headings are the cuts' business: feet and inertia level a shot but do not turn it
    if iteration < _TURN_FROM:
        block[:, 3:6] = 1e8
    known = np.array([rig.scale_known or not np.any(rig.path) for rig in rigs])
    block[known, 6] = 1e8
    step = rows.step(damping)
    moved = step[cameras:].reshape(len(rigs), CAMERA_UNKNOWNS)
    # A scale neither changes sign nor runs away in one step.
    scale = np.clip(state.scale + moved[:, 6], 0.3 * state.scale, 3.0 * state.scale)
    return _State(
        pelvis=[p + step[firsts[k] : firsts[k + 1]].reshape(-1, 3) for k, p in enumerate(state.pelvis)],
        turn=rotation_from_vector(moved[:, 3:6]) @ state.turn,
        origin=state.origin + moved[:, :3],
        scale=scale,
    )


def _observations(
    rows: _Rows,
    strand: Strand,
    rig: ShotRig,
    state: _State,
    index: int,
    pelvis: Int[Array, "n"],
    camera: int,
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
        factor = np.sqrt(np.minimum(1.0, 2.0 / np.maximum(size, 1e-9)))[:, None]
        residual, whiten = residual * factor, whiten * factor[..., None]
    own = np.full(len(pelvis), camera)
    rows.add(
        residual,
        (pelvis, whiten),
        (own, -whiten),
        (own + 3, whiten @ skew(arm)),
        (own + 6, -whiten @ path[..., None]),
    )


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
    rows: _Rows,
    strand: Strand,
    state: _State,
    index: int,
    pelvis: Int[Array, "n"],
    camera: int,
    options: SolveSettings,
    *,
    floor: bool,
) -> None:
    """Feet that stand still keep their place, those that bear the body are on the floor, none is below it."""
    if len(pelvis) < 2:
        return
    turned = strand.feet @ state.turn[strand.shot].T
    place = turned + state.pelvis[index][:, None]
    still, on_floor = _hold(strand, state, index, options)
    correlated = np.sqrt(max(1.0, options.correlation_s / _frame_step(strand.time_s)))
    step = np.diff(strand.time_s)[:, None]
    weight = np.sqrt(still) / (options.still_ms * step) / np.sqrt(correlated)
    for foot in range(4):
        w = weight[:, foot, None, None] * np.eye(3)
        moved = place[1:, foot] - place[:-1, foot]
        swing = turned[1:, foot] - turned[:-1, foot]
        own = np.full(len(moved), camera + 3)
        rows.add(
            weight[:, foot, None] * moved,
            (pelvis[1:], w),
            (pelvis[:-1], -w),
            (own, -weight[:, foot, None, None] * skew(swing)),
        )
    if not floor:
        return
    below = place[..., 2] < 0
    bearing = np.sqrt(np.where(below, np.maximum(on_floor, 0.5), on_floor)) / options.floor_m / correlated
    for foot in range(4):
        own = np.full(len(pelvis), camera + 3)
        lever = -skew(turned[:, foot])[:, 2:3]
        rows.add(
            (bearing[:, foot] * place[:, foot, 2])[:, None],
            (pelvis + 2, bearing[:, foot, None, None]),
            (own, bearing[:, foot, None, None] * lever),
        )


def _inertia(
    rows: _Rows,
    pelvis: Float[Array, "n 3"],
    time_s: Float[Array, "n"],
    unknown: Int[Array, "n"],
    options: SolveSettings,
) -> None:
    """Velocity changes slowly, across cuts as well; over a hole it may have changed more."""
    if len(pelvis) < 2:
        return
    step = np.diff(time_s)
    velocity = np.diff(pelvis, axis=0) / step[:, None]
    # Where acceleration says nothing (two frames, a long hole) the speed is at least one that a person can have.
    loose = np.flatnonzero(step > _HOLE_S) if len(pelvis) > 2 else np.arange(len(step))
    slope = (1 / (_PERSON_SPEED_MS * step[loose]))[:, None, None] * np.eye(3)
    rows.add(velocity[loose] / _PERSON_SPEED_MS, (unknown[loose + 1], slope), (unknown[loose], -slope))
    if len(pelvis) < 3:
        return
    middle = 0.5 * (step[1:] + step[:-1])
    sigma = options.acceleration_ms2 * middle / np.sqrt(1 + middle / _ACCELERATION_S)
    residual = (velocity[1:] - velocity[:-1]) / sigma[:, None]
    after, before = 1 / (step[1:] * sigma), 1 / (step[:-1] * sigma)
    rows.add(
        residual,
        (unknown[2:], after[:, None, None] * np.eye(3)),
        (unknown[1:-1], -(after + before)[:, None, None] * np.eye(3)),
        (unknown[:-2], before[:, None, None] * np.eye(3)),
    )


_PERSON_SPEED_MS = 3.0
_ACCELERATION_S = 0.3
"""A push lasts about so long: over longer times velocity changes like a random walk."""


def _levels(rows: _Rows, joins: Sequence[Join], state: _State, cameras: int, options: SolveSettings) -> None:
    """Every shot stays about as level as it came, neighbouring shots turned to each other as their link says."""
    for k in range(len(state.turn)):
        first = np.array([cameras + CAMERA_UNKNOWNS * k + 3])
        w = 1 / np.deg2rad(options.level_deg)
        rows.add(w * vector_from_rotation(state.turn[k])[None], (first, w * np.eye(3)[None]))
    for join in joins:
        w = 1 / np.deg2rad(join.sigma_deg)
        a, b = (np.array([cameras + CAMERA_UNKNOWNS * k + 3]) for k in (join.shot_a, join.shot_b))
        difference = vector_from_rotation(state.turn[join.shot_b]) - vector_from_rotation(state.turn[join.shot_a])
        rows.add(w * difference[None], (b, w * np.eye(3)[None]), (a, -w * np.eye(3)[None]))


def _same_places(rows: _Rows, rigs: Sequence[ShotRig], same: Sequence[SamePlace], state: _State, cameras: int) -> None:
    """A standing camera that returns stands where it stood."""
    w = 1 / _SAME_PLACE_M
    for place in same:
        difference, blocks = np.zeros(3), []
        for shot, frame, sign in ((place.shot_a, place.frame_a, 1.0), (place.shot_b, place.frame_b, -1.0)):
            arm = state.scale[shot] * rigs[shot].path[frame - rigs[shot].start] @ state.turn[shot].T
            difference = difference + sign * (state.origin[shot] + arm)
            first = np.array([cameras + CAMERA_UNKNOWNS * shot])
            blocks.append((first, sign * w * np.eye(3)[None]))
            blocks.append((first + 3, -sign * w * skew(arm)[None]))
        rows.add(w * difference[None], *blocks)


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
