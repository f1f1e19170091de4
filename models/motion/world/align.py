"""One world from many shots: rotations through the cuts, gravity from the upright, places from `world_solve`.

Shots that share people hang together (paper section 3.3.1); a shot that shares nobody with any other keeps gravity
and floor and gets an origin of its own. World axes: z up, floor at z = 0, +y the first camera's horizontal heading,
the first person's first pelvis above the origin.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import chunks, forward_kinematics
from humanmm.models.body.landmarks import load_landmarks
from humanmm.models.camera.keyframes import ViewFeatures
from humanmm.models.camera.shot_edges import ShotLink, link_shots
from humanmm.models.cuts.camera_rotation import CutCameras, CutPerson, SideTrack, align_cut
from humanmm.models.geometry.intervals import in_intervals
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.world import gravity as world_gravity
from humanmm.models.motion.world.people import Part, joined
from humanmm.models.motion.world.shot_rotations import Edge, ShotRotations, average_rotations
from humanmm.models.motion.world.solver import Join, SamePlace, ShotRig, Solution, Strand, solve
from humanmm.models.records.camera import SOURCES, Intrinsics, ShotCamera, through_lens
from humanmm.models.records.motion import CutAlignment, PersonShotMotion, ShotMotion, WorldMotion
from humanmm.models.records.shots import ShotList
from humanmm.models.records.tracks import ScenePeople

Array = np.ndarray

SOLES = (29, 31, 30, 32)
"""Landmarks of the feet: left heel, left toes, right heel, right toes."""
SIDE_S = 0.5
"""So much of a track on each side is handed to the alignment of a cut."""
MIN_JOIN_SIGMA_DEG = 4.0


@dataclass(frozen=True)
class Footage:
    """Everything `align` reads, one entry a shot where it is a list; None where that shot failed."""

    shots: ShotList
    scenes: Sequence[ScenePeople | None]
    cameras: Sequence[ShotCamera | None]
    motions: Sequence[ShotMotion | None]
    time_s: Float[Array, "F"]
    intrinsics: Intrinsics
    views: Sequence[Sequence[ViewFeatures]]
    """Key views of every shot, people left out; empty where there are none."""


@dataclass(frozen=True)
class _Link:
    """Shot `later` hangs on shot `earlier`."""

    earlier: int
    later: int
    cut: CutAlignment


def assemble(
    footage: Footage,
    *,
    method: Literal["bundle", "eight-point"] = "bundle",
    known_turns: Mapping[int, Float[Array, "3 3"]] | None = None,
) -> WorldMotion:
    """People and cameras of the whole video in one world.

    `known_turns`: by first frame of a shot, camera axes of that frame to those of the frame before, where they are
    known from elsewhere; neighbouring shots that share people are joined by them.
    """
    links = [
        _link(footage, later, method, known_turns or {})
        for later in range(1, len(footage.shots.shots))
        if _usable(footage, later)
    ]
    places = _places(footage)
    rotations = average_rotations(
        len(footage.shots.shots), [_people_edge(footage, link) for link in links if link.cut.linked], places.edges
    )
    groups = _groups(footage, rotations)
    F = len(footage.time_s)
    world = _Canvas(
        R=np.tile(np.eye(3), (F, 1, 1)),
        t=np.zeros((F, 3)),
        K=np.tile(footage.intrinsics.K, (F, 1, 1)),
        source=np.full(F, SOURCES.index("fallback"), np.uint8),
        people={},
    )
    warnings: list[str] = []
    for group in groups:
        warnings += _place_group(footage, group, rotations, places, world)
    _fill_cameras(footage, world)
    warnings += [warning for link in links for warning in link.cut.warnings]
    warnings += _lifted(footage)
    if len(groups) > 1:
        names = ", ".join(str(group[0]) for group in groups[1:])
        warnings.append(f"shots {names} share nobody with the shots before: from each on the world has a new origin")
    return WorldMotion(
        R_world_cam=world.R,
        t_world_cam=world.t,
        K=world.K,
        camera_source=world.source,
        people=tuple(joined(person, parts) for person, parts in sorted(world.people.items())),
        cuts=tuple(_reported(footage, links, rotations, world)),
        warnings=tuple(warnings),
    )


def _lifted(footage: Footage) -> list[str]:
    """Who is known from 2D keypoints alone."""
    people = {
        appearance.person
        for shot in footage.shots.shots
        for appearance in shot.people
        if (scene := footage.scenes[shot.scene]) is not None and scene.tracks[appearance.track].lifted
    }
    return [
        f"person {person}: the detector gives 2D keypoints only; depth and orientation were lifted from them, rougher"
        for person in sorted(people)
    ]


@dataclass(frozen=True)
class _Canvas:
    """The world as it fills up, frame by frame."""

    R: Array
    t: Array
    K: Array
    source: Array
    people: dict[int, list[Part]]


def _usable(footage: Footage, shot: int) -> bool:
    return footage.cameras[shot] is not None and footage.motions[shot] is not None


def _motion_of(footage: Footage, shot: int) -> dict[int, PersonShotMotion]:
    motion = footage.motions[shot]
    return {person.person: person for person in motion.people} if motion is not None else {}


def _link(
    footage: Footage,
    later: int,
    method: Literal["bundle", "eight-point"],
    known_turns: Mapping[int, Float[Array, "3 3"]],
) -> _Link:
    """How a shot hangs on the latest earlier one in which one of its people is seen."""
    here = _motion_of(footage, later)
    earlier = next(
        (k for k in range(later - 1, -1, -1) if _usable(footage, k) and here.keys() & _motion_of(footage, k).keys()),
        later - 1,
    )
    before, after = footage.cameras[earlier], footage.cameras[later]
    shared = sorted(here.keys() & _motion_of(footage, earlier).keys())
    people = []
    for person in shared:
        first = _side(footage, earlier, person, last=True)
        second = _side(footage, later, person, last=False)
        if first is not None and second is not None:
            people.append(CutPerson(first, second))
    shot = footage.shots.shots[later]
    if people and earlier == later - 1 and shot.start in known_turns:
        gap_s = min(float(p.after.time_s[0] - p.before.time_s[-1]) for p in people)
        R = known_turns[shot.start]
        return _Link(earlier, later, CutAlignment(shot.start, "given", R, float("nan"), 0.0, gap_s, True))
    cameras = CutCameras(
        K_before=before.K[-1] if before is not None else footage.intrinsics.K,
        K_after=after.K[0] if after is not None else footage.intrinsics.K,
        moving=any(camera is not None and camera.source == "tracked" for camera in (before, after)),
    )
    middle = 0.5 * float(footage.time_s[max(shot.start - 1, 0)] + footage.time_s[shot.start])
    if people:
        middle = 0.5 * (max(p.before.time_s[-1] for p in people) + min(p.after.time_s[0] for p in people))
    return _Link(earlier, later, align_cut(people, cameras, cut_frame=shot.start, cut_time_s=middle, method=method))


def _side(footage: Footage, shot_index: int, person: int, *, last: bool) -> SideTrack | None:
    """The observations of one person in the half second of a shot that faces the cut."""
    shot = footage.shots.shots[shot_index]
    scene, camera = footage.scenes[shot.scene], footage.cameras[shot_index]
    appearance = next((a for a in shot.people if a.person == person), None)
    if scene is None or camera is None or appearance is None:
        return None
    track = scene.track_of(appearance)
    inside = in_intervals(track.frame, [shot.outside_transitions])
    rows = np.flatnonzero(inside & ~in_intervals(track.frame, appearance.tracking_failures))
    if not len(rows):
        return None
    time_s = footage.time_s[track.frame[rows]]
    near = (time_s >= time_s[-1] - SIDE_S) if last else (time_s <= time_s[0] + SIDE_S)
    rows = rows[near]
    frame = track.frame[rows]
    at_cut = -1 if last else 0
    R_at_cut = camera.R_shot_cam[at_cut]
    keypoints2d = track.keypoints2d[rows].copy()
    keypoints2d[..., :2] = through_lens(keypoints2d[..., :2], camera.K[frame - camera.start], camera.K[at_cut])
    motion = _motion_of(footage, shot_index).get(person)
    R_cam_root = None
    if motion is not None and frame[0] >= motion.frame[0] and frame[-1] <= motion.frame[-1]:
        R_cam_root = motion.R_cam_root[frame - motion.frame[0]]
    return SideTrack(
        time_s=footage.time_s[frame],
        keypoints2d=keypoints2d,
        landmarks3d=track.landmarks3d[rows],
        R_cam_root=R_cam_root,
        R_cut_cam=R_at_cut.T @ camera.R_shot_cam[frame - camera.start],
    )


@dataclass(frozen=True)
class _Places:
    """What the background says of the shots: rotations, and which frames one standing camera took."""

    edges: tuple[Edge, ...]
    same: tuple[ShotLink, ...]


def _places(footage: Footage) -> _Places:
    intrinsics = footage.intrinsics
    usable = [
        [_with_lens(view, _camera(footage, k), intrinsics.K) for view in views] if _usable(footage, k) else []
        for k, views in enumerate(footage.views)
    ]
    links = link_shots(usable, K=intrinsics.K, focal_uncertainty=intrinsics.relative_uncertainty)
    edges = []
    for link in links:
        R_a, R_b = (
            _camera(footage, shot).R_shot_cam[frame - footage.shots.shots[shot].start]
            for shot, frame in ((link.shot_a, link.view.frame_a), (link.shot_b, link.view.frame_b))
        )
        edges.append(
            Edge(
                link.shot_a,
                link.shot_b,
                R_a @ link.view.R_a_b @ R_b.T,
                link.sigma_deg,
                num_inliers=link.view.num_inliers,
                same_camera=link.view.same_camera,
            )
        )
    return _Places(tuple(edges), tuple(link for link in links if link.view.same_camera))


def _with_lens(view: ViewFeatures, camera: ShotCamera, K: Float[Array, "3 3"]) -> ViewFeatures:
    """The view as if its camera had not zoomed."""
    xy = through_lens(view.xy[None], camera.K[[view.frame - camera.start]], K)[0]
    return replace(view, xy=xy.astype(np.float32)) if camera.zooms else view


def _people_edge(footage: Footage, link: _Link) -> Edge:
    before, after = _camera(footage, link.earlier), _camera(footage, link.later)
    R = before.R_shot_cam[-1] @ link.cut.R_before_after @ after.R_shot_cam[0].T
    return Edge(link.earlier, link.later, R, max(link.cut.uncertainty_deg, MIN_JOIN_SIGMA_DEG))


def _camera(footage: Footage, shot: int) -> ShotCamera:
    camera = footage.cameras[shot]
    if camera is None:
        raise ValueError(f"shot {shot} has no camera")
    return camera


def _groups(footage: Footage, rotations: ShotRotations) -> list[list[int]]:
    """Usable shots that hang together, in order."""
    groups: dict[int, list[int]] = {}
    for shot, group in enumerate(rotations.group):
        if _usable(footage, shot):
            groups.setdefault(group, []).append(shot)
    return list(groups.values())


def _place_group(
    footage: Footage, group: Sequence[int], rotations: ShotRotations, places: _Places, world: _Canvas
) -> list[str]:
    """Level and place the shots of one group, and write them into the world; returns warnings."""
    R_first_shot = [rotations.R_group_shot[group[0]].T @ rotations.R_group_shot[shot] for shot in group]
    R_world_shot = {k: R for k, R in zip(group, _levelled(footage, group, R_first_shot), strict=True)}
    strands, owners = [], []
    for index, shot in enumerate(group):
        for motion in _motion_of(footage, shot).values():
            strands.append(_strand(footage, index, shot, motion, R_world_shot[shot]))
            owners.append((shot, motion))
    rigs = [_rig(footage, shot, R_world_shot[shot]) for shot in group]
    position = {shot: index for index, shot in enumerate(group)}
    joins = [
        Join(position[edge.a], position[edge.b], edge.sigma_deg)
        for edge in rotations.believed
        if edge.a in position and edge.b in position
    ]
    same = [
        SamePlace(position[link.shot_a], link.view.frame_a, position[link.shot_b], link.view.frame_b)
        for link in places.same
        if link.shot_a in position and link.shot_b in position
    ]
    solution = solve(strands, rigs, joins, same)
    solution = _at_origin(solution, strands, R_world_shot[group[0]])
    for index, shot in enumerate(group):
        camera = _camera(footage, shot)
        R_world = solution.turn[index] @ R_world_shot[shot]
        frames = slice(camera.start, camera.end)
        world.R[frames] = R_world @ camera.R_shot_cam
        world.t[frames] = solution.origin[index] + solution.scale[index] * camera.t_shot_cam @ R_world.T
        world.K[frames] = camera.K
        world.source[frames] = SOURCES.index(camera.source)
    for (_, motion), pelvis, contacts in zip(owners, solution.pelvis, solution.contacts, strict=True):
        R_root = world.R[motion.frame] @ motion.R_cam_root
        world.people.setdefault(motion.person, []).append(Part(motion, R_root, pelvis, contacts))
    return [
        f"shot {shot}: nobody's feet tell the scale of the camera's path; its unit is taken for a metre"
        for shot, rig in zip(group, rigs, strict=True)
        if not rig.scale_known and not _motion_of(footage, shot)
    ]


def _levelled(
    footage: Footage, group: Sequence[int], R_first_shot: Sequence[Float[Array, "3 3"]]
) -> list[Float[Array, "3 3"]]:
    """Each shot's axes to world axes: gravity from the evidence of all shots, +y where the first camera looks."""
    up, up_sigma, level, level_sigma = [], [], [], []
    for shot, R in zip(group, R_first_shot, strict=True):
        camera = _camera(footage, shot)
        for axis, sigma in _standing(footage, shot):
            up.append(R @ axis)
            up_sigma.append(sigma)
        level.append(R @ _mean_x(camera))
        level_sigma.append(world_gravity.ROLL_SIGMA_DEG)
        turned_about = world_gravity.pan_axis(camera.R_shot_cam)
        if turned_about is not None:
            # The axis is vertical: any direction across it is level.
            for across in np.linalg.svd(turned_about[None])[2][1:]:
                level.append(R @ across)
                level_sigma.append(2 * world_gravity.PAN_SIGMA_DEG)
        # The picture's own vertical: hardly informed, but never upside down.
        up.append(R @ camera.R_shot_cam[0] @ np.array([0.0, -1.0, 0.0]))
        up_sigma.append(25.0)
    z = world_gravity.up_direction(
        world_gravity.UprightEvidence(np.array(up), np.array(up_sigma), np.array(level), np.array(level_sigma))
    )
    first = _camera(footage, group[0])
    y = _heading(first.R_shot_cam[0], z)
    R_world_first = np.stack([np.cross(y, z), y, z])
    return [R_world_first @ R for R in R_first_shot]


def _heading(R_cam: Float[Array, "3 3"], z: Float[Array, "3"]) -> Float[Array, "3"]:
    """Horizontal direction in which a camera looks; where it looks straight down, the top of its picture."""
    ahead = R_cam[:, 2] - z * (z @ R_cam[:, 2])
    if np.linalg.norm(ahead) < 0.05:
        ahead = -R_cam[:, 1] + z * (z @ R_cam[:, 1])
    return np.asarray(ahead / np.linalg.norm(ahead))


def _mean_x(camera: ShotCamera) -> Float[Array, "3"]:
    """Mean x axis of a shot's camera, shot axes."""
    x = camera.R_shot_cam[..., 0].mean(axis=0)
    return np.asarray(x / max(float(np.linalg.norm(x)), 1e-9))


def _standing(footage: Footage, shot: int) -> list[tuple[Float[Array, "3"], float]]:
    """Mean standing axis of each person of a shot, shot axes, with its sigma in degrees."""
    camera = _camera(footage, shot)
    found = []
    for motion in _motion_of(footage, shot).values():
        seen = motion.observed
        if not seen.any():
            continue
        R_shot_cam = camera.R_shot_cam[motion.frame - camera.start]
        joints, _ = _posed(motion, R_shot_cam)
        axis, weight = world_gravity.standing_axis(joints[seen])
        found.append(world_gravity.mean_axis(axis, weight))
    return found


def _posed(
    motion: PersonShotMotion, R_axes_cam: Float[Array, "n 3 3"]
) -> tuple[Float[Array, "n 24 3"], Float[Array, "n 4 3"]]:
    """Joints and sole points about the pelvis, in axes turned by R_axes_cam."""
    rest, landmarks = load_body().rest_joints(motion.betas), load_landmarks()
    n = len(motion.frame)
    joints, soles = np.empty((n, len(rest), 3)), np.empty((n, len(SOLES), 3))
    for frames in chunks(n):
        R_root = R_axes_cam[frames] @ motion.R_cam_root[frames]
        joints[frames], R = forward_kinematics(rest, R_root, motion.body_pose[frames], np.zeros((len(R_root), 3)))
        soles[frames] = landmarks.place(motion.betas, joints[frames], R)[:, list(SOLES)]
    return joints, soles


def _strand(
    footage: Footage, index: int, shot: int, motion: PersonShotMotion, R_world_shot: Float[Array, "3 3"]
) -> Strand:
    camera = _camera(footage, shot)
    R_world_cam = R_world_shot @ camera.R_shot_cam[motion.frame - camera.start]
    _, soles = _posed(motion, R_world_cam)
    return Strand(
        person=motion.person,
        shot=index,
        frame=motion.frame,
        time_s=footage.time_s[motion.frame],
        offset=np.einsum("nab,nb->na", R_world_cam, motion.pelvis_cam),
        feet=soles,
        weight=np.where(motion.observed, motion.confidence.astype(np.float64), 0.0),
    )


def _rig(footage: Footage, shot: int, R_world_shot: Float[Array, "3 3"]) -> ShotRig:
    camera = _camera(footage, shot)
    return ShotRig(
        path=camera.t_shot_cam @ R_world_shot.T,
        start=camera.start,
        scale=1.0,
        scale_known=camera.metric or not np.any(camera.t_shot_cam),
    )


def _at_origin(solution: Solution, strands: Sequence[Strand], R_world_first: Float[Array, "3 3"]) -> Solution:
    """The same world with the first camera's heading along +y and the first person's first pelvis above the origin."""
    ahead = solution.turn[0] @ R_world_first[:, 2]
    yaw = float(np.arctan2(ahead[0], ahead[1])) if np.hypot(ahead[0], ahead[1]) > 0.05 else 0.0
    R = rotvec_to_rotmat(np.array([0.0, 0.0, yaw]))
    shift = np.zeros(3)
    if strands:
        first = min(range(len(strands)), key=lambda k: (strands[k].person, int(strands[k].frame[0])))
        shift[:2] = (R @ solution.pelvis[first][0])[:2]
    elif len(solution.origin):
        shift[:2] = (R @ solution.origin[0])[:2]
    return replace(
        solution,
        pelvis=tuple(pelvis @ R.T - shift for pelvis in solution.pelvis),
        turn=R @ solution.turn,
        origin=solution.origin @ R.T - shift,
    )


def _fill_cameras(footage: Footage, world: _Canvas) -> None:
    """Frames of failed shots get the nearest known camera; they keep the code of a fallback."""
    known = np.zeros(len(world.R), dtype=bool)
    for index, shot in enumerate(footage.shots.shots):
        if _usable(footage, index):
            known[shot.start : shot.end] = True
    frames = np.flatnonzero(known)
    if not len(frames):
        return
    for frame in np.flatnonzero(~known):
        nearest = frames[np.argmin(np.abs(frames - frame))]
        world.R[frame], world.t[frame], world.K[frame] = world.R[nearest], world.t[nearest], world.K[nearest]


def _reported(footage: Footage, links: Sequence[_Link], rotations: ShotRotations, world: _Canvas) -> list[CutAlignment]:
    """The cuts with the relative rotation that the finished world has."""
    found = {link.later: link.cut for link in links}
    cuts = []
    for index, shot in enumerate(footage.shots.shots[1:], start=1):
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
                linked=_usable(footage, index) and rotations.group[index] != index,
                background_inliers=max([0, *(edge.num_inliers for edge in background)]),
            )
        )
    return cuts
