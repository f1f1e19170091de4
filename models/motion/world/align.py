"""One world from many shots: rotations through the cuts, gravity from the upright, positions from `solver`.

Shots that share people are connected (paper section 3.3.1); a shot that shares nobody with any other keeps gravity
and floor and gets an origin of its own. World axes: z up, floor at z = 0, +y the first camera's horizontal heading,
the first person's first pelvis above the origin.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from humanmm.models.cuts.camera_rotation import CutMethod, align_by_bundle
from humanmm.models.geometry.intrinsics import K_of
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.world.levelling import levelled
from humanmm.models.motion.world.people import Part, concatenated
from humanmm.models.motion.world.shot_graph import BackgroundEdges, CutEdge, background_edges, cut_edge, people_edge
from humanmm.models.motion.world.shot_results import ShotResults, camera_of, motions_of, posed, usable
from humanmm.models.motion.world.shot_rotations import ShotRotations, average_rotations
from humanmm.models.motion.world.solver import SameCamera, ShotRig, ShotTrajectory, Solution, solve
from humanmm.models.records.camera import SOURCES
from humanmm.models.records.motion import CutAlignment, PersonShotMotion, WorldMotion

__all__ = ["ShotResults", "align"]

Array = np.ndarray


def align(
    results: ShotResults,
    *,
    method: CutMethod = align_by_bundle,
    known_rotations: Mapping[int, Float[Array, "3 3"]] | None = None,
) -> WorldMotion:
    """People and cameras of the whole video in one world.

    `method` finds how the camera rotated at a cut. `known_rotations`: by first frame of a shot, camera axes of that
    frame to those of the frame before, where they are known from elsewhere; neighbouring shots that share people are
    joined by them.
    """
    edges = [
        cut_edge(results, later, method, known_rotations or {})
        for later in range(1, len(results.shots.shots))
        if usable(results, later)
    ]
    background = background_edges(results)
    rotations = average_rotations(
        len(results.shots.shots), [people_edge(results, edge) for edge in edges if edge.cut.linked], background.edges
    )
    groups = _groups(results, rotations)
    F = len(results.time_s)
    world = _World(
        R=np.tile(np.eye(3), (F, 1, 1)),
        t=np.zeros((F, 3)),
        K=np.tile(K_of(results.intrinsics), (F, 1, 1)),
        source=np.full(F, SOURCES.index("fallback"), np.uint8),
        people={},
    )
    warnings: list[str] = []
    for group in groups:
        warnings += _solve_group(results, group, rotations, background, world)
    _fill_cameras(results, world)
    warnings += [warning for edge in edges for warning in edge.cut.warnings]
    warnings += _lifted(results)
    if len(groups) > 1:
        names = ", ".join(str(group[0]) for group in groups[1:])
        warnings.append(f"shots {names} share nobody with the shots before: from each on the world has a new origin")
    return WorldMotion(
        R_world_cam=world.R,
        t_world_cam=world.t,
        K=world.K,
        camera_source=world.source,
        people=tuple(concatenated(person, parts) for person, parts in sorted(world.people.items())),
        cuts=tuple(_reported(results, edges, rotations, world)),
        warnings=tuple(warnings),
    )


def _lifted(results: ShotResults) -> list[str]:
    """Who is known from 2D keypoints alone."""
    people = {
        appearance.person
        for shot in results.shots.shots
        for appearance in shot.people
        if (scene := results.scenes[shot.scene]) is not None and scene.tracks[appearance.track].lifted
    }
    return [
        f"person {person}: the detector gives 2D keypoints only; depth and orientation were lifted from them, rougher"
        for person in sorted(people)
    ]


@dataclass(frozen=True)
class _World:
    """The world as it fills up, frame by frame."""

    R: Array
    t: Array
    K: Array
    source: Array
    people: dict[int, list[Part]]


def _groups(results: ShotResults, rotations: ShotRotations) -> list[list[int]]:
    """Usable shots that edges connect, in order."""
    groups: dict[int, list[int]] = {}
    for shot, group in enumerate(rotations.group):
        if usable(results, shot):
            groups.setdefault(group, []).append(shot)
    return list(groups.values())


def _solve_group(
    results: ShotResults, group: Sequence[int], rotations: ShotRotations, background: BackgroundEdges, world: _World
) -> list[str]:
    """Level the shots of one group, solve for their positions, and write them into the world; returns warnings."""
    R_first_shot = [rotations.R_group_shot[group[0]].T @ rotations.R_group_shot[shot] for shot in group]
    R_world_shot = {k: R for k, R in zip(group, levelled(results, group, R_first_shot), strict=True)}
    trajectories, owners = [], []
    for k, shot in enumerate(group):
        for motion in motions_of(results, shot).values():
            trajectories.append(_trajectory(results, k, shot, motion, R_world_shot[shot]))
            owners.append((shot, motion))
    rigs = [_rig(results, shot, R_world_shot[shot]) for shot in group]
    index = {shot: k for k, shot in enumerate(group)}
    edges = [
        replace(edge, a=index[edge.a], b=index[edge.b])
        for edge in rotations.believed
        if edge.a in index and edge.b in index
    ]
    same = [
        SameCamera(index[edge.shot_a], edge.frames.frame_a, index[edge.shot_b], edge.frames.frame_b)
        for edge in background.same
        if edge.shot_a in index and edge.shot_b in index
    ]
    solution = solve(trajectories, rigs, edges, same)
    solution = _at_origin(solution, trajectories, R_world_shot[group[0]])
    for k, shot in enumerate(group):
        camera = camera_of(results, shot)
        R_world = solution.rotation[k] @ R_world_shot[shot]
        frames = slice(camera.start, camera.end)
        world.R[frames] = R_world @ camera.R_shot_cam
        world.t[frames] = solution.origin[k] + solution.scale[k] * camera.t_shot_cam @ R_world.T
        world.K[frames] = camera.K
        world.source[frames] = SOURCES.index(camera.source)
    for (_, motion), pelvis, contacts in zip(owners, solution.pelvis, solution.contacts, strict=True):
        R_root = world.R[motion.frame] @ motion.R_cam_root
        world.people.setdefault(motion.person, []).append(Part(motion, R_root, pelvis, contacts))
    return [
        f"shot {shot}: nobody's feet tell the scale of the camera's path; its unit is taken for a metre"
        for shot, rig in zip(group, rigs, strict=True)
        if not rig.scale_known and not motions_of(results, shot)
    ]


def _trajectory(
    results: ShotResults, index: int, shot: int, motion: PersonShotMotion, R_world_shot: Float[Array, "3 3"]
) -> ShotTrajectory:
    camera = camera_of(results, shot)
    R_world_cam = R_world_shot @ camera.R_shot_cam[motion.frame - camera.start]
    _, soles = posed(motion, R_world_cam)
    return ShotTrajectory(
        person=motion.person,
        shot=index,
        frame=motion.frame,
        time_s=results.time_s[motion.frame],
        offset=np.einsum("nab,nb->na", R_world_cam, motion.pelvis_cam),
        feet=soles,
        weight=np.where(motion.observed, motion.confidence.astype(np.float64), 0.0),
    )


def _rig(results: ShotResults, shot: int, R_world_shot: Float[Array, "3 3"]) -> ShotRig:
    camera = camera_of(results, shot)
    return ShotRig(
        path=camera.t_shot_cam @ R_world_shot.T,
        start=camera.start,
        scale=1.0,
        scale_known=camera.metric or not np.any(camera.t_shot_cam),
    )


def _at_origin(
    solution: Solution, trajectories: Sequence[ShotTrajectory], R_world_first: Float[Array, "3 3"]
) -> Solution:
    """The same world with the first camera's heading along +y and the first person's first pelvis above the origin."""
    ahead = solution.rotation[0] @ R_world_first[:, 2]
    yaw = float(np.arctan2(ahead[0], ahead[1])) if np.hypot(ahead[0], ahead[1]) > 0.05 else 0.0
    R = rotvec_to_rotmat(np.array([0.0, 0.0, yaw]))
    shift = np.zeros(3)
    if trajectories:
        first = min(range(len(trajectories)), key=lambda k: (trajectories[k].person, int(trajectories[k].frame[0])))
        shift[:2] = (R @ solution.pelvis[first][0])[:2]
    elif len(solution.origin):
        shift[:2] = (R @ solution.origin[0])[:2]
    return replace(
        solution,
        pelvis=tuple(pelvis @ R.T - shift for pelvis in solution.pelvis),
        rotation=R @ solution.rotation,
        origin=solution.origin @ R.T - shift,
    )


def _fill_cameras(results: ShotResults, world: _World) -> None:
    """Frames of failed shots get the nearest known camera; they keep the code of a fallback."""
    known = np.zeros(len(world.R), dtype=bool)
    for index, shot in enumerate(results.shots.shots):
        if usable(results, index):
            known[shot.start : shot.end] = True
    frames = np.flatnonzero(known)
    if not len(frames):
        return
    for frame in np.flatnonzero(~known):
        nearest = frames[np.argmin(np.abs(frames - frame))]
        world.R[frame], world.t[frame], world.K[frame] = world.R[nearest], world.t[nearest], world.K[nearest]


def _reported(
    results: ShotResults, edges: Sequence[CutEdge], rotations: ShotRotations, world: _World
) -> list[CutAlignment]:
    """The cuts with the relative rotation that the finished world has."""
    found = {edge.later: edge.cut for edge in edges}
    cuts = []
    for index, shot in enumerate(results.shots.shots[1:], start=1):
        failed = CutAlignment(shot.start, "none", np.eye(3), float("nan"), 180.0, float("nan"), False)
        cut = found.get(index, failed)
        background = [
            edge for edge in rotations.believed if edge.num_inliers and {edge.a, edge.b} == {index - 1, index}
        ]
        cuts.append(
            replace(
                cut,
                R_before_after=world.R[shot.start - 1].T @ world.R[shot.start],
                uncertainty_deg=min([cut.uncertainty_deg, *(edge.sigma_deg for edge in background)]),
                linked=usable(results, index) and rotations.group[index] != index,
                background_inliers=max([0, *(edge.num_inliers for edge in background)]),
            )
        )
    return cuts
