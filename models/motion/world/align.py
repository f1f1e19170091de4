"""One world from many shots: rotations through the cuts, gravity from the upright, positions from `solver`.

Shots that share people are connected (paper section 3.3.1); a shot that shares nobody with any other keeps gravity
and floor and gets an origin of its own. World axes: z up, floor at z = 0, +y the first camera's horizontal heading,
the first person's first pelvis above the origin.
"""

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, UInt8

from humanmm.machine import single_threaded
from humanmm.models.body.body24 import load_body
from humanmm.models.body.proportions import resized
from humanmm.models.cuts.camera_rotation import CutMethod, align_by_bundle
from humanmm.models.cuts.continuity import pose_jumps
from humanmm.models.geometry.intrinsics import K_of
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.rotations.levelling import levelled
from humanmm.models.motion.rotations.rotation_mixtures import Upright
from humanmm.models.motion.rotations.shot_results import (
    ShotResults,
    camera_of,
    motions_of,
    posed,
    refocused,
    usable,
    witnesses_of,
)
from humanmm.models.motion.rotations.shot_rotations import ShotRotations
from humanmm.models.motion.world import doubts
from humanmm.models.motion.world.people import Part, concatenated
from humanmm.models.motion.world.problem import CameraEdge, SameCamera, ShotRig, ShotTrajectory
from humanmm.models.motion.world.solver import Solution, solve, with_riders
from humanmm.models.motion.world.witnesses import WITNESSES, FoundRotations, find_rotations
from humanmm.models.records.camera import SOURCES, Intrinsics
from humanmm.models.records.motion import (
    CutAlignment,
    PathScale,
    PersonShotMotion,
    RotationEvidence,
    WorldMotion,
)
from humanmm.models.video.progress import Progress, silent

__all__ = ["ShotResults", "align"]

Array = np.ndarray


@single_threaded
def align(
    results: ShotResults,
    *,
    method: CutMethod = align_by_bundle,
    known_rotations: Mapping[int, Float[Array, "3 3"]] | None = None,
    witnesses: Set[str] = WITNESSES,
    progress: Progress = silent,
) -> WorldMotion:
    """People and cameras of the whole video in one world.

    `method` finds how the camera rotated at a cut. `known_rotations`: by first frame of a shot, camera axes of that
    frame to those of the frame before, where they are known from elsewhere; neighbouring shots that share people are
    joined by them. Of WITNESSES all but `witnesses` are not used; shots are one world all the same where they share
    somebody.
    """
    world = _aligned(results, method, known_rotations or {}, witnesses, progress)
    change = abs(float(np.log(world.focal_factor)))
    if change < REFOCUSED:
        return world
    disputed = change > DISPUTED * results.intrinsics.relative_uncertainty
    # With the focal length that the whole video says, or with the estimate where that is not believed, what decided
    # early may be decided otherwise.
    settled = results if disputed else refocused(results, world.focal_factor)
    again = _aligned(settled, method, known_rotations or {}, witnesses, progress, focal=1.0)
    return replace(again, focal_dispute=change) if disputed else replace(again, focal_factor=world.focal_factor)


def _aligned(
    results: ShotResults,
    method: CutMethod,
    known_rotations: Mapping[int, Float[Array, "3 3"]],
    witnesses: Set[str],
    progress: Progress,
    focal: float | None = None,
) -> WorldMotion:
    """See `align`; `focal`: how many times as long as `results` have it the focal length is, None if it is open."""
    found = find_rotations(results, method, known_rotations, witnesses, progress)
    # The largest world decides on the focal length.
    groups = sorted(_groups(results, found.rotations), key=lambda group: -_num_frames(results, group))
    world = _World.empty(results)
    scales: list[PathScale] = []
    for group in groups:
        own_scales, focal = _solve_group(results, group, found, world, focal)
        scales.extend(own_scales)
    scales.sort(key=lambda scale: scale.shot)
    facings, pose_errors = doubts.facings_of(results), doubts.pose_errors_of(results)
    _fill_cameras(results, world)
    cuts = _reported(results, found, world)
    paths = [world.t[shot.start : shot.end] for shot in results.shots.shots]
    warnings = [
        *doubts.of_paths(scales, paths),
        *(warning for cut in cuts for warning in cut.warnings),
        *doubts.of_jumps(cuts, results.certain),
        *doubts.of_facings(facings, results.certain),
        *doubts.of_pose_errors(pose_errors, results.certain),
        *doubts.of_sides(found.rotations),
        *doubts.of_lifted(results),
        *doubts.of_groups(sorted(groups)),
    ]
    return WorldMotion(
        R_world_cam=world.R,
        t_world_cam=world.t,
        K=world.K,
        camera_source=world.source,
        people=tuple(concatenated(person, parts) for person, parts in sorted(world.people.items())),
        cuts=tuple(cuts),
        warnings=tuple(warnings),
        evidence=_evidence(found.rotations),
        path_scales=tuple(scales),
        focal_factor=1.0 if focal is None else focal,
        facings=tuple(facings),
        pose_errors=tuple(pose_errors),
    )


LEAST_STD_DEG = 0.1
"""Standard deviation of a rotation between two shots: no less is believed."""

REFOCUSED = 0.04
"""From a focal length that is off by so much (of its logarithm) on everything is decided again with the right one."""

DISPUTED = 2.0
"""What feet and paths say of the focal length is not believed if it lies farther from the estimate than so many of the
estimate's standard deviations: of 57 rendered development clips 55 stay within 0.8, and the two others, at 3.4, had
their focal length, known to 10 %, made wrong by 33 and 44 %."""

UNKNOWN_SCALE = 3.0
"""Standard deviation of the logarithm of a path's scale from which it is not known at all (a factor of 20): the solve
is linear in scales, and of one that it makes nearly 0 it gives any number."""

FOCAL_TRUST, MOST_FOCAL_STD = 0.5, 0.1
"""What feet and paths say of the focal length is held against its estimate, whose standard deviation counts by so much
and no more. Where there is no estimate they make it too short: an assumed focal length stays
(docs/measurements/world.md)."""


@dataclass(eq=False)
class _World:
    """The world of F frames as it fills up, one group of shots after the other: written in place."""

    R: Float[Array, "F 3 3"]
    """R_world_cam."""
    t: Float[Array, "F 3"]
    """t_world_cam, metres."""
    K: Float[Array, "F 3 3"]
    source: UInt8[Array, " F"]
    """Where the camera comes from, numbers of `SOURCES`."""
    people: dict[int, list[Part]]
    """By person, the shots in which he is."""

    @classmethod
    def empty(cls, results: ShotResults) -> "_World":
        """No camera known, nobody there."""
        F = len(results.time_s)
        return cls(
            R=np.tile(np.eye(3), (F, 1, 1)),
            t=np.zeros((F, 3)),
            K=np.tile(K_of(results.intrinsics), (F, 1, 1)),
            source=np.full(F, SOURCES.index("fallback"), np.uint8),
            people={},
        )


def _groups(results: ShotResults, rotations: ShotRotations) -> list[list[int]]:
    """Usable shots that edges connect, in order."""
    groups: dict[int, list[int]] = {}
    for shot, group in enumerate(rotations.group):
        if usable(results, shot):
            groups.setdefault(group, []).append(shot)
    return list(groups.values())


def _num_frames(results: ShotResults, group: Sequence[int]) -> int:
    shots = results.shots.shots
    return sum(shots[shot].end - shots[shot].start for shot in group)


def _solve_group(
    results: ShotResults, group: Sequence[int], found: FoundRotations, world: _World, focal: float | None
) -> tuple[list[PathScale], float]:
    """Level the shots of one group, solve for their positions, and write them into the world.

    `focal`: how many times as long as estimated the focal length is; None where the solve is to find it. Returns how
    well the scales of the cameras' paths are known, and that factor.
    """
    R_group_shot = found.rotations.R_group_shot
    R_first_shot = [R_group_shot[group[0]].T @ R_group_shot[shot] for shot in group]
    R_world_shot = {k: R for k, R in zip(group, levelled(results, group, R_first_shot, found.verticals), strict=True)}
    known_heights = {person.person for person in results.shots.people if person.height_known}
    witnesses: list[tuple[ShotTrajectory, PersonShotMotion]] = []
    riders: list[tuple[ShotTrajectory, PersonShotMotion]] = []
    for k, shot in enumerate(group):
        judged_by = witnesses_of(results, shot)
        for motion in motions_of(results, shot).values():
            known = motion.person in known_heights
            trajectory = _trajectory(results, k, shot, motion, R_world_shot[shot], size_known=known)
            (witnesses if motion.person in judged_by else riders).append((trajectory, motion))
    trajectories = [trajectory for trajectory, _ in witnesses]
    rigs = [_rig(results, shot, R_world_shot[shot], found.verticals[shot].upright) for shot in group]
    edges, same = _ties(group, found)
    if focal is None:
        solution = solve(trajectories, rigs, edges, same, focal_std=_focal_std(results.intrinsics))
        focal = solution.focal
    else:
        solution = solve([one.seen_through(float(np.log(focal))) for one in trajectories], rigs, edges, same)
    solution = with_riders(solution, [one.seen_through(float(np.log(focal))) for one, _ in riders], rigs)
    everybody = [*witnesses, *riders]
    solution = _at_origin(solution, [trajectory for trajectory, _ in everybody], R_world_shot[group[0]])
    for k, shot in enumerate(group):
        camera = camera_of(results, shot)
        R_world = solution.rotation[k] @ R_world_shot[shot]
        frames = slice(camera.start, camera.end)
        world.R[frames] = R_world @ camera.R_shot_cam
        world.t[frames] = solution.origin[k] + solution.scale[k] * camera.t_shot_cam @ R_world.T
        world.K[frames] = camera.K * np.array([[focal, 1, 1], [1, focal, 1], [1, 1, 1]])
        world.source[frames] = SOURCES.index(camera.source)
    for (_, motion), pelvis, contacts in zip(everybody, solution.pelvis, solution.contacts, strict=True):
        R_root = world.R[motion.frame] @ motion.R_cam_root
        factor = 1.0 if motion.person in known_heights else solution.size[motion.person]
        sized = replace(motion, betas=resized(motion.betas, load_body(), factor))
        world.people.setdefault(motion.person, []).append(Part(sized, R_root, pelvis, contacts))
    scales = [
        _path_scale(shot, solution, k, seen=bool(motions_of(results, shot)))
        for k, (shot, rig) in enumerate(zip(group, rigs, strict=True))
        if not rig.scale_known
    ]
    return scales, focal


def _ties(group: Sequence[int], found: FoundRotations) -> tuple[list[CameraEdge], list[SameCamera]]:
    """What ties the cameras of a group to one another: rotations, and frames that one static camera took."""
    index = {shot: k for k, shot in enumerate(group)}
    edges = [
        CameraEdge(index[one.edge.a], index[one.edge.b], max(one.hypothesis.sigma_deg, LEAST_STD_DEG))
        for one in found.rotations.believed
        if one.edge.a in index and one.edge.b in index
    ]
    trusted = {(one.edge.a, one.edge.b) for one in found.rotations.believed if one.edge.source == "same camera"}
    same = [
        SameCamera(index[edge.shot_a], edge.frames[0].frame_a, index[edge.shot_b], edge.frames[0].frame_b)
        for edge in found.background.same
        if (edge.shot_a, edge.shot_b) in trusted and edge.shot_a in index and edge.shot_b in index
    ]
    return edges, same


def _focal_std(intrinsics: Intrinsics) -> float:
    """Standard deviation of the logarithm of the focal length, for the solve; 0 where that is not to change it."""
    if intrinsics.source != "estimated":
        return 0.0
    return min(FOCAL_TRUST * intrinsics.relative_uncertainty, MOST_FOCAL_STD)


def _path_scale(shot: int, solution: Solution, index: int, *, seen: bool) -> PathScale:
    if not seen:
        return PathScale(shot, "assumed", float("nan"))
    uncertainty = min(float(solution.log_scale_std[index]), UNKNOWN_SCALE)
    return PathScale(shot, "floor" if solution.from_floor[index] else "feet", uncertainty)


def _trajectory(
    results: ShotResults,
    index: int,
    shot: int,
    motion: PersonShotMotion,
    R_world_shot: Float[Array, "3 3"],
    *,
    size_known: bool,
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
        ahead=R_world_cam[:, :, 2],
        size_known=size_known,
    )


def _rig(results: ShotResults, shot: int, R_world_shot: Float[Array, "3 3"], upright: Upright) -> ShotRig:
    camera = camera_of(results, shot)
    rig = ShotRig(
        path=camera.t_shot_cam @ R_world_shot.T,
        start=camera.start,
        scale=1.0,
        scale_known=camera.metric or not camera.travels,
        level_deg=upright.sigma_deg,
        up=R_world_shot @ upright.direction,
    )
    if camera.scenery is None:
        return rig
    return replace(rig, scenery=camera.scenery.positions @ R_world_shot.T, relative_std=camera.scenery.relative_std)


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


def _reported(results: ShotResults, found: FoundRotations, world: _World) -> list[CutAlignment]:
    """The cuts with the relative rotation that the finished world has."""
    edge_before, rotations = {edge.later: edge for edge in found.cuts}, found.rotations
    cuts = []
    for index, shot in enumerate(results.shots.shots[1:], start=1):
        failed = CutAlignment(shot.start, "none", np.eye(3), float("nan"), 180.0, float("nan"), False)
        edge = edge_before.get(index)
        cut = edge.cut if edge is not None else failed
        background = [
            one.edge.num_inliers
            for one in rotations.believed
            if one.edge.num_inliers and {one.edge.a, one.edge.b} == {index - 1, index}
        ]
        certainty = rotations.certainty[index]
        cut = replace(
            cut,
            R_before_after=world.R[shot.start - 1].T @ world.R[shot.start],
            uncertainty_deg=certainty.sigma_deg if certainty is not None else 180.0,
            within_95_deg=certainty.within_95_deg if certainty is not None else 180.0,
            probability=certainty.probability if certainty is not None else 0.0,
            linked=usable(results, index) and rotations.group[index] != index,
            background_inliers=max([0, *background]),
            pose_jumps=pose_jumps(motions_of(results, index - 1), motions_of(results, index), results.time_s),
        )
        cuts.append(replace(cut, warnings=doubts.of_cut(cut)))
    return cuts


def _evidence(rotations: ShotRotations) -> tuple[RotationEvidence, ...]:
    """Everything that spoke for a rotation between two shots, for the record."""
    used = [
        RotationEvidence(
            one.edge.a, one.edge.b, one.hypothesis.source or one.edge.source, one.edge.num_inliers, True, ""
        )
        for one in rotations.believed
    ]
    unused = [
        RotationEvidence(
            one.edge.a, one.edge.b, one.edge.source, one.edge.num_inliers, False,
            "nothing else connects the two shots" if np.isnan(one.off_deg)
            else f"its nearest rotation is {one.off_deg:.0f}° from what all evidence together says",
        )
        for one in rotations.refused
    ]  # fmt: skip
    return tuple(sorted([*used, *unused], key=lambda one: (one.shot_a, one.shot_b, one.source)))
