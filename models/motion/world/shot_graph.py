"""The edges between shots: relative rotations from the people at the cuts and from the backgrounds of two shots."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from humanmm.models.camera.background.keyframes import FrameFeatures
from humanmm.models.camera.background.shot_edges import ShotEdge, find_shot_edges
from humanmm.models.cuts.camera_rotation import CutCameras, CutMethod, CutPerson, SideTrack
from humanmm.models.geometry.intervals import in_intervals
from humanmm.models.geometry.intrinsics import K_of
from humanmm.models.motion.world.shot_results import ShotResults, camera_of, motions_of, usable
from humanmm.models.motion.world.shot_rotations import RotationEdge
from humanmm.models.records.camera import ShotCamera, through_lens
from humanmm.models.records.motion import CutAlignment

Array = np.ndarray

SIDE_S = 0.5
"""So much of a track on each side is handed to the alignment of a cut."""
LEAST_STD_DEG = 4.0
"""Standard deviation of a cut's rotation from people: no less than this is believed."""


@dataclass(frozen=True)
class CutEdge:
    """The edge from shot `earlier` to shot `later`, by the people whom both see."""

    earlier: int
    later: int
    cut: CutAlignment


@dataclass(frozen=True)
class BackgroundEdges:
    """What the background says of the shots: rotations, and which frames one static camera took."""

    edges: tuple[RotationEdge, ...]
    same: tuple[ShotEdge, ...]


def cut_edge(
    results: ShotResults,
    later: int,
    method: CutMethod,
    known_rotations: Mapping[int, Float[Array, "3 3"]],
) -> CutEdge:
    """The edge to a shot from the latest earlier one in which one of its people is seen."""
    here = motions_of(results, later)
    earlier = next(
        (k for k in range(later - 1, -1, -1) if usable(results, k) and here.keys() & motions_of(results, k).keys()),
        later - 1,
    )
    before, after = results.cameras[earlier], results.cameras[later]
    shared = sorted(here.keys() & motions_of(results, earlier).keys())
    certain = {person.person for person in results.shots.people if not person.doubtful}
    shared = [person for person in shared if person in certain] or shared
    people = []
    for person in shared:
        first = _side(results, earlier, person, last=True)
        second = _side(results, later, person, last=False)
        if first is not None and second is not None:
            people.append(CutPerson(first, second))
    shot = results.shots.shots[later]
    if people and earlier == later - 1 and shot.start in known_rotations:
        gap_s = min(float(p.after.time_s[0] - p.before.time_s[-1]) for p in people)
        R = known_rotations[shot.start]
        return CutEdge(earlier, later, CutAlignment(shot.start, "given", R, float("nan"), 0.0, gap_s, True))
    cameras = CutCameras(
        K_before=before.K[-1] if before is not None else K_of(results.intrinsics),
        K_after=after.K[0] if after is not None else K_of(results.intrinsics),
        moving=any(camera is not None and camera.source == "tracked" for camera in (before, after)),
    )
    middle = 0.5 * float(results.time_s[max(shot.start - 1, 0)] + results.time_s[shot.start])
    if people:
        middle = 0.5 * (max(p.before.time_s[-1] for p in people) + min(p.after.time_s[0] for p in people))
    return CutEdge(earlier, later, method(people, cameras, cut_frame=shot.start, cut_time_s=middle))


def _side(results: ShotResults, shot_index: int, person: int, *, last: bool) -> SideTrack | None:
    """The observations of one person in the half second of a shot that faces the cut."""
    shot = results.shots.shots[shot_index]
    scene, camera = results.scenes[shot.scene], results.cameras[shot_index]
    appearance = next((a for a in shot.people if a.person == person), None)
    if scene is None or camera is None or appearance is None:
        return None
    track = scene.track_of(appearance)
    inside = in_intervals(track.frame, [shot.outside_transitions])
    rows = np.flatnonzero(inside & ~in_intervals(track.frame, appearance.tracking_failures))
    if not len(rows):
        return None
    time_s = results.time_s[track.frame[rows]]
    near = (time_s >= time_s[-1] - SIDE_S) if last else (time_s <= time_s[0] + SIDE_S)
    rows = rows[near]
    frame = track.frame[rows]
    at_cut = -1 if last else 0
    R_at_cut = camera.R_shot_cam[at_cut]
    keypoints2d = track.keypoints2d[rows].copy()
    keypoints2d[..., :2] = through_lens(keypoints2d[..., :2], camera.K[frame - camera.start], camera.K[at_cut])
    motion = motions_of(results, shot_index).get(person)
    R_cam_root = None
    if motion is not None and frame[0] >= motion.frame[0] and frame[-1] <= motion.frame[-1]:
        R_cam_root = motion.R_cam_root[frame - motion.frame[0]]
    return SideTrack(
        time_s=results.time_s[frame],
        keypoints2d=keypoints2d,
        landmarks3d=track.landmarks3d[rows],
        R_cam_root=R_cam_root,
        R_cut_cam=R_at_cut.T @ camera.R_shot_cam[frame - camera.start],
    )


def people_edge(results: ShotResults, edge: CutEdge) -> RotationEdge:
    """The same between the axes of the two shots instead of the cameras at the cut."""
    before, after = camera_of(results, edge.earlier), camera_of(results, edge.later)
    R = before.R_shot_cam[-1] @ edge.cut.R_before_after @ after.R_shot_cam[0].T
    return RotationEdge(edge.earlier, edge.later, R, max(edge.cut.uncertainty_deg, LEAST_STD_DEG))


def background_edges(results: ShotResults) -> BackgroundEdges:
    """Edges between the axes of all shots whose backgrounds match."""
    intrinsics, K = results.intrinsics, K_of(results.intrinsics)
    key_frames = [
        [_with_lens(frame, camera_of(results, k), K) for frame in frames] if usable(results, k) else []
        for k, frames in enumerate(results.key_frames)
    ]
    shot_edges = find_shot_edges(key_frames, K=K, focal_uncertainty=intrinsics.relative_uncertainty)
    edges = []
    for edge in shot_edges:
        R_a, R_b = (
            camera_of(results, shot).R_shot_cam[frame - results.shots.shots[shot].start]
            for shot, frame in ((edge.shot_a, edge.frames.frame_a), (edge.shot_b, edge.frames.frame_b))
        )
        edges.append(
            RotationEdge(
                edge.shot_a,
                edge.shot_b,
                R_a @ edge.frames.R_a_b @ R_b.T,
                edge.sigma_deg,
                num_inliers=edge.frames.num_inliers,
                same_camera=edge.frames.same_camera,
            )
        )
    return BackgroundEdges(tuple(edges), tuple(edge for edge in shot_edges if edge.frames.same_camera))


def _with_lens(features: FrameFeatures, camera: ShotCamera, K: Float[Array, "3 3"]) -> FrameFeatures:
    """The features as if its camera had not zoomed."""
    xy = through_lens(features.xy[None], camera.K[[features.frame - camera.start]], K)[0]
    return replace(features, xy=xy.astype(np.float32)) if camera.zooms else features
