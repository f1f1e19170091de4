"""The edges between shots: relative rotations from the people at the cuts and from the backgrounds of two shots."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from humanmm.models.camera.background.keyframes import FrameFeatures
from humanmm.models.camera.background.shot_edges import ShotEdge, find_shot_edges, sigma_deg
from humanmm.models.cuts.camera_rotation import CutMethod
from humanmm.models.cuts.sides import CutCameras, CutPerson, SideTrack
from humanmm.models.geometry.intervals import in_intervals
from humanmm.models.geometry.intrinsics import K_of
from humanmm.models.geometry.rotations import angle_between_deg, rotvec_to_rotmat
from humanmm.models.motion.rotations.rotation_mixtures import RotationEdge, RotationHypothesis, Upright
from humanmm.models.motion.rotations.shot_results import ShotResults, camera_of, motions_of, usable
from humanmm.models.records.camera import ShotCamera, through_lens
from humanmm.models.records.motion import CutAlignment, CutHypothesis

Array = np.ndarray

SIDE_S = 0.5
"""So much of a track on each side is handed to the alignment of a cut."""
CLUSTER_DEG = 6.0
"""Hypotheses of two shots' backgrounds that lie closer together are one, found at several pairs of key frames."""
DEPENDENCE = 0.5
"""Several pairs of key frames of the same two shots are no independent witnesses: each counts as half of one."""
ALIKE_WALLS, ALIKE_DEG = 0.25, 2.0
"""Probability that two shots which seem to show one wall show two that look alike, and how far from right angles such
walls stand. With 0, 0.1 and 0.25, 62, 56 and 57 of the rotations at 322 development cuts are wrong by more than 30°,
and 6, 3 and 3 of these have a probability above 0.8 (docs/measurements/cuts.md)."""
CONNECTING = 0.6
"""Probability from which a background alone shows that two shots belong to one world."""


@dataclass(frozen=True)
class CutEdge:
    """The rotation between shots `earlier` and `later` by each person whom both show."""

    earlier: int
    later: int
    cuts: tuple[CutAlignment, ...]
    """One for each person, the most certain first; one that is not `linked` where there is nobody."""
    people: tuple[int, ...] = ()
    """Their numbers, as far as they are known."""

    @property
    def cut(self) -> CutAlignment:
        """The most certain one."""
        return self.cuts[0]


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
    here = motions_of(results, later).keys() - results.insets
    earlier = next(
        (k for k in range(later - 1, -1, -1) if usable(results, k) and here & motions_of(results, k).keys()), later - 1
    )
    before, after = results.cameras[earlier], results.cameras[later]
    shared = sorted(here & motions_of(results, earlier).keys())
    certain = results.certain
    shared = [person for person in shared if person in certain] or shared
    people: list[tuple[int, CutPerson]] = []
    for person in shared:
        first = _side(results, earlier, person, last=True)
        second = _side(results, later, person, last=False)
        if first is not None and second is not None:
            people.append((person, CutPerson(first, second)))
    shot = results.shots.shots[later]
    if people and earlier == later - 1 and shot.start in known_rotations:
        gap_s = min(float(p.after.time_s[0] - p.before.time_s[-1]) for _, p in people)
        R = known_rotations[shot.start]
        return CutEdge(earlier, later, (CutAlignment(shot.start, "given", R, float("nan"), 0.0, gap_s, True),))
    cameras = CutCameras(
        K_before=before.K[-1] if before is not None else K_of(results.intrinsics),
        K_after=after.K[0] if after is not None else K_of(results.intrinsics),
        moving=any(camera is not None and camera.travels for camera in (before, after)),
    )
    cuts: list[tuple[int, CutAlignment]] = []
    for person, one in people:
        middle = 0.5 * float(one.before.time_s[-1] + one.after.time_s[0])
        cuts.append((person, method([one], cameras, cut_frame=shot.start, cut_time_s=middle)))
    cuts.sort(key=lambda cut: (not cut[1].linked, cut[1].uncertainty_deg))
    if not cuts:
        middle = 0.5 * float(results.time_s[max(shot.start - 1, 0)] + results.time_s[shot.start])
        return CutEdge(earlier, later, (method([], cameras, cut_frame=shot.start, cut_time_s=middle),))
    return CutEdge(earlier, later, tuple(cut for _, cut in cuts), tuple(person for person, _ in cuts))


def _side(results: ShotResults, shot_index: int, person: int, *, last: bool) -> SideTrack | None:
    """The observations of one person in the half second of a shot that faces the cut."""
    shot = results.shots.shots[shot_index]
    scene, camera = results.scenes[shot.scene], results.cameras[shot_index]
    appearance = next((a for a in shot.people if a.person == person), None)
    if scene is None or camera is None or appearance is None:
        return None
    track = scene.track_of(appearance)
    inside = in_intervals(track.frame, [shot.clear])
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


def people_edges(
    results: ShotResults, edge: CutEdge, identities: Mapping[tuple[int, int], float]
) -> list[RotationEdge]:
    """The same between the axes of the two shots instead of the cameras at the cut; one edge a person.

    `identities`: by person and shot, the probability that he is who he is said to be. A body that is somebody else's
    gives no edge. The same camera sees all bodies, and what it makes the pose network get wrong they have in common:
    together they are as certain as one of them.
    """
    before, after = camera_of(results, edge.earlier), camera_of(results, edge.later)
    R_before, R_after = before.R_shot_cam[-1], after.R_shot_cam[0]
    shared = float(np.sqrt(max(1, sum(cut.linked for cut in edge.cuts))))
    edges = []
    for k, cut in enumerate(edge.cuts):
        if not cut.linked:
            continue
        source = f"person {edge.people[k]}" if edge.people else "people"
        same = identities.get((edge.people[k], edge.later), 1.0) if edge.people else 1.0
        hypotheses = cut.hypotheses or (
            CutHypothesis(cut.R_before_after, cut.uncertainty_deg, 1.0 if cut.method == "given" else 0.9, cut.method),
        )
        inside_shots = tuple(
            RotationHypothesis(
                R_before @ one.R_before_after @ R_after.T,
                shared * one.sigma_deg,
                same * one.probability,
                one.source.replace("people", source),
            )
            for one in hypotheses
        )
        edges.append(RotationEdge(edge.earlier, edge.later, inside_shots, source))
    return edges


def background_edges(results: ShotResults) -> BackgroundEdges:
    """Edges between the axes of all shots whose backgrounds match."""
    intrinsics, K = results.intrinsics, K_of(results.intrinsics)
    key_frames = [
        [_with_lens(frame, camera_of(results, k), K) for frame in results.key_frames_of(k)]
        if usable(results, k)
        else []
        for k in range(len(results.key_frames))
    ]
    shot_edges = find_shot_edges(key_frames, K=K)
    edges = tuple(_in_shot_axes(results, edge, intrinsics.relative_uncertainty) for edge in shot_edges)
    return BackgroundEdges(edges, tuple(edge for edge in shot_edges if edge.frames[0].same_camera))


def _in_shot_axes(results: ShotResults, edge: ShotEdge, focal_uncertainty: float) -> RotationEdge:
    """All hypotheses of two shots' key frames as rotations between the shots; those that agree are one."""
    R_a, R_b = (camera_of(results, shot).R_shot_cam for shot in (edge.shot_a, edge.shot_b))
    first_a, first_b = (results.shots.shots[shot].start for shot in (edge.shot_a, edge.shot_b))
    found = [
        (
            one,
            RotationHypothesis(
                R_a[frames.frame_a - first_a] @ one.R_a_b @ R_b[frames.frame_b - first_b].T,
                sigma_deg(one, focal_uncertainty),
                one.probability,
                one.source,
            ),
        )
        for frames in edge.frames
        for one in frames.hypotheses
    ]
    found.sort(key=lambda pair: pair[1].sigma_deg)
    clusters: list[list[RotationHypothesis]] = []
    for _, one in found:
        near = next((c for c in clusters if angle_between_deg(c[0].R_a_b, one.R_a_b) < CLUSTER_DEG), None)
        if near is None:
            clusters.append([one])
        else:
            near.append(one)
    merged = [
        replace(
            cluster[0],
            probability=1
            - (1 - cluster[0].probability) * float(np.prod([1 - c.probability for c in cluster[1:]])) ** DEPENDENCE,
        )
        for cluster in clusters
    ]
    total = sum(one.probability for one in merged)
    share = min(1.0, max(frames.probability for frames in edge.frames) / total)
    sources = {one.source for one, _ in found}
    return RotationEdge(
        edge.shot_a,
        edge.shot_b,
        tuple(replace(one, probability=one.probability * share) for one in merged),
        source="same camera" if edge.frames[0].same_camera else " and ".join(sorted(sources)),
        num_inliers=max(one.num_inliers for one, _ in found),
        connects=total * share >= CONNECTING,
    )


def with_alike(
    edges: Sequence[RotationEdge], upright: Sequence[Upright | None], probability: float, what: str
) -> list[RotationEdge]:
    """The edges of backgrounds or floors, with what follows if two that look alike were taken for one.

    A room's walls stand at right angles, and tiles lie along them: each hypothesis may be a quarter or half of a turn
    about the vertical off, however many points agree on it. `upright`: one a shot; where a vertical is unknown an edge
    stays as it is; `probability`: of all three turns; `what`: looks alike, for the record.
    """
    found = []
    for edge in edges:
        up = upright[edge.a]
        if up is None or edge.source == "same camera":
            found.append(edge)
            continue
        turned = [
            replace(
                one,
                R_a_b=rotvec_to_rotmat(up.direction * turn) @ one.R_a_b,
                sigma_deg=math.hypot(one.sigma_deg, up.sigma_deg, ALIKE_DEG),
                probability=probability * share * one.probability,
                source=f"{one.source}, {what}",
            )
            for one in edge.hypotheses
            for turn, share in ((math.pi, 0.5), (math.pi / 2, 0.25), (-math.pi / 2, 0.25))
        ]
        seen = [replace(one, probability=(1 - probability) * one.probability) for one in edge.hypotheses]
        found.append(replace(edge, hypotheses=(*seen, *turned)))
    return found


def _with_lens(features: FrameFeatures, camera: ShotCamera, K: Float[Array, "3 3"]) -> FrameFeatures:
    """The features as a camera with the lens K sees them: they may come of a zoom, or of a lens of the shot's own."""
    K_seen = camera.K[features.frame - camera.start]
    if np.array_equal(K_seen, K):
        return features
    xy = through_lens(features.xy[None], K_seen[None], K)[0]
    return replace(features, xy=xy.astype(np.float32))
