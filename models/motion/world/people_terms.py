"""What is known of people, as equations: where pictures show them, their sizes, their inertia, their feet."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from humanmm.models.geometry.robust import huber_weight
from humanmm.models.geometry.rotations import skew
from humanmm.models.motion.world.equations import WorldEquations, segments_of
from humanmm.models.motion.world.feet import add_feet
from humanmm.models.motion.world.problem import ShotRig, ShotTrajectory
from humanmm.models.motion.world.state import DENSE_S, SolveSettings, WorldState, as_solved, people_of

Array = np.ndarray

PERSON_SPEED_MS = 3.0
"""Standard deviation of a person's speed where acceleration says nothing: over a hole, and of two frames alone."""
ACCELERATION_S = 0.3
"""A push lasts about so long: over longer times velocity changes like a random walk."""
LEAST_WEIGHT = 0.05
"""No frame counts for less, however little was seen of somebody in it (of 0..1)."""
HUBER = 2.0
"""In standard deviations: beyond it an observation counts linearly."""


def equations_of_people(
    trajectories: Sequence[ShotTrajectory],
    rigs: Sequence[ShotRig],
    state: WorldState,
    settings: SolveSettings,
    *,
    robust: bool,
    still: bool,
    floor: bool,
    held: bool = False,
) -> WorldEquations:
    """The equations with all that is known of people. `trajectories`: by person, then by time.

    `held`: the cameras are known, and with them how large everybody is before them.
    `robust`: observations far off count less; `still`: feet that stand keep their position; `floor`: those that bear
    the body are on the floor.
    """
    people = people_of(trajectories)
    of_person = [people.index(trajectory.person) for trajectory in trajectories]
    segments = segments_of(of_person, [one.shot for one in trajectories], [one.time_s for one in trajectories])
    equations = WorldEquations(segments, len(rigs))
    for k, sized in enumerate(as_solved(trajectories, state)):
        _add_observations(equations, sized, rigs[sized.shot], state, k, settings, robust=robust)
        if still:
            add_feet(equations, sized, rigs[sized.shot], state, k, settings, floor=floor)
    for person in range(len(people)):
        own = [k for k, owner in enumerate(of_person) if owner == person]
        time_s = np.concatenate([trajectories[k].time_s for k in own])
        pelvis = np.concatenate([state.pelvis[k] for k in own])
        hole_s = max(trajectories[k].hole_s for k in own)
        _add_inertia(equations, pelvis, time_s, segments[own[0]].start, settings, hole_s=hole_s, robust=robust)
    known = {trajectory.person for trajectory in trajectories if trajectory.size_known}
    seen = [sum(np.maximum(one.weight, LEAST_WEIGHT).sum() for one in trajectories if one.person == p) for p in people]
    _add_sizes(equations, state, [person in known for person in people], None if held else np.array(seen), settings)
    return equations


def _add_observations(
    equations: WorldEquations,
    trajectory: ShotTrajectory,
    rig: ShotRig,
    state: WorldState,
    index: int,
    settings: SolveSettings,
    *,
    robust: bool,
) -> None:
    """The person is where the picture shows, loosely along the line of sight; from frame to frame he goes across it as
    the picture shows, which errors that change slowly leave nearly exact."""
    T = state.rotation[trajectory.shot]
    path = rig.path[trajectory.frame - rig.start] @ T.T
    offset = trajectory.offset @ T.T
    arm = state.scale[trajectory.shot] * path + offset
    error = state.pelvis[index] - state.origin[trajectory.shot] - arm
    distance = np.linalg.norm(offset, axis=1)
    sight = (offset / distance[:, None])[:, :, None]
    along = sight @ sight.transpose(0, 2, 1)
    across = np.eye(3) - along
    correlated = max(1.0, settings.correlation_s / trajectory.step_s)
    weight = np.maximum(trajectory.weight, LEAST_WEIGHT)
    along_m = settings.depth_fraction * distance[:, None, None]
    whiten = np.sqrt(weight / correlated)[:, None, None] * (across / settings.across_m + along / along_m)
    ahead = trajectory.ahead @ T.T
    deeper = np.sum(offset * ahead, axis=1, keepdims=True) * ahead
    identity = np.broadcast_to(np.eye(3), along.shape)
    # Along and across turn with the shot: seen from it, all that turns is where the person is from its origin.
    turned = skew(state.pelvis[index] - state.origin[trajectory.shot])
    by_shared = np.concatenate([-identity, turned, *(-one[..., None] for one in (path, offset, deeper))], axis=-1)
    if robust:
        size = np.linalg.norm(np.einsum("nab,nb->na", whiten, error), axis=1) * np.sqrt(correlated)
        whiten = whiten * _huber_root(size)[:, None, None]
    equations.add_positions(index, np.einsum("nab,nb->na", whiten, error), whiten, whiten @ by_shared)

    if len(error) < 2:
        return
    step_s, moved = np.diff(trajectory.time_s), np.diff(error, axis=0)
    seen = np.sqrt(np.minimum(weight[1:], weight[:-1])) * (step_s < trajectory.hole_s)
    whiten = (seen / (settings.across_step_m * np.sqrt(step_s / DENSE_S)))[:, None, None] * across[:-1]
    if robust:
        size = np.linalg.norm(np.einsum("nab,nb->na", whiten, moved), axis=1) * np.sqrt(np.maximum(1, DENSE_S / step_s))
        whiten = whiten * _huber_root(size)[:, None, None]
    equations.add_moves(index, whiten[:, None], moved[:, None], np.diff(by_shared, axis=0)[:, None])


def _add_sizes(
    equations: WorldEquations,
    state: WorldState,
    known: Sequence[bool],
    seen: Float[np.ndarray, " P"] | None,
    settings: SolveSettings,
) -> None:
    """People differ in size, but by what factor all of them do no picture says, unless somebody's height is known.

    `seen`: frames of each, by their trust: who is seen for longer has more of a say in the size of all. None where
    cameras say how large all are.
    """
    if not known:
        return
    size = state.log_size
    sigma = np.where(known, settings.known_size_std, np.where(size > 0, settings.taller_std, settings.smaller_std))
    # Evidence that asks for more than twice that is rather wrong: the cost grows with the sixth power.
    steep = (size / (2 * sigma)) ** 2
    residual, rows = size / sigma * (1 + steep), np.diag((1 + 3 * steep) / sigma)
    if seen is not None and not any(known):
        mean = seen / (seen.sum() * settings.mean_size_std)
        residual, rows = np.append(residual, mean @ size), np.vstack([rows, mean])
    people = np.concatenate([equations.size(person) for person in range(len(known))])
    equations.add_shared(residual, (people, rows))


def _add_inertia(
    equations: WorldEquations,
    pelvis: Float[Array, "n 3"],
    time_s: Float[Array, "n"],
    first: int,
    settings: SolveSettings,
    *,
    hole_s: float,
    robust: bool,
) -> None:
    """Velocity changes slowly, across cuts as well; over a hole, and where somebody jumps, it may have changed more."""
    if len(pelvis) < 2:
        return
    step = np.diff(time_s)
    velocity = np.diff(pelvis, axis=0) / step[:, None]
    # Where acceleration says nothing (two frames, a long hole) the speed is at least one that a person can have.
    loose = np.flatnonzero(step > hole_s) if len(pelvis) > 2 else np.arange(len(step))
    slope = 1 / (PERSON_SPEED_MS * step[loose])
    equations.add_chain(first + loose, np.stack([-slope, slope], axis=1), velocity[loose] / PERSON_SPEED_MS)
    if len(pelvis) < 3:
        return
    middle = 0.5 * (step[1:] + step[:-1])
    # The sum over dense frames is an integral of the squared acceleration: its terms count by time, σ² goes by time.
    counted = np.maximum(middle, DENSE_S)
    sigma = settings.acceleration_ms2 * np.sqrt(middle * counted) / np.sqrt(1 + counted / ACCELERATION_S)
    after, before = 1 / (step[1:] * sigma), 1 / (step[:-1] * sigma)
    coefficients = np.stack([before, -(after + before), after], axis=1)
    residual = np.diff(velocity, axis=0) / sigma[:, None]
    if robust:
        trust = _huber_root(np.linalg.norm(residual, axis=1) * np.sqrt(counted / middle))[:, None]
        residual, coefficients = residual * trust, coefficients * trust
    equations.add_chain(first + np.arange(len(coefficients)), coefficients, residual)


def _huber_root(size: Float[Array, " n"]) -> Float[Array, " n"]:
    """What residuals of this size, in standard deviations, are multiplied by so that large ones count linearly."""
    return np.asarray(np.sqrt(huber_weight(size, HUBER)))
