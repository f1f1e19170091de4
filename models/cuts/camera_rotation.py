"""Relative camera rotation at a cut, from the people seen on both sides (paper section 3.3.1, improved; see
docs/method.md).

`bundle`: a few rotations are guessed (rotation between the two sides' 3D points, between the fitted bodies, PnP of
one side's 3D points into the other's picture), each starts a small bundle adjustment (`cut_bundle`), the cheapest
wins. `eight-point`: the paper's method, an essential matrix from the keypoints of the two frames around the cut
(`epipolar`).
"""

from collections.abc import Sequence
from typing import Protocol

import cv2
import numpy as np
from jaxtyping import Float, Int

from humanmm.models.cuts import bundle as cut_bundle
from humanmm.models.cuts import epipolar
from humanmm.models.cuts.hypotheses import fitted_body_rotation, hypotheses_of
from humanmm.models.cuts.residuals import BodyPoints, BundleSettings, PersonAtCut, SideView
from humanmm.models.cuts.sides import CutCameras, CutPerson, SideTrack
from humanmm.models.geometry.alignment import kabsch
from humanmm.models.geometry.projection import ray_axes, viewing_rays
from humanmm.models.geometry.rotations import angle_between_deg, nearest_rotation, rotvec_to_rotmat
from humanmm.models.records.motion import CutAlignment

Array = np.ndarray

POINTS = (0, 7, 8, 11, 12, 13, 14, 15, 16, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32)
"""Landmarks that take part: nose, ears, shoulders, elbows, wrists, hips, knees, ankles, heels, toes."""

_BODY = BodyPoints(
    hips=(9, 10),
    bones=(
        (3, 5), (4, 6), (5, 7), (6, 8), (9, 11), (10, 12), (11, 13), (12, 14), (13, 17), (14, 18), (3, 9), (4, 10),
        (3, 4), (9, 10),
    ),
)  # fmt: skip
"""Bones in terms of POINTS; left and right stand side by side, so that their lengths can be shared."""

_NUM_PAIRS = 6
"""The first 2 × 6 bones are left/right pairs."""

_IMAGE_WEIGHT = np.array([0.2] * 3 + [1.0] * 2 + [0.5] * 4 + [1.0] * 6 + [0.6] * 4)
"""Trust in the image points: faces are guessed when seen from behind, wrists and feet move fast."""

_ROTATION_WEIGHT = np.array([0.2] * 3 + [1.0] * 2 + [0.3] * 4 + [1.0] * 6 + [0.3] * 4)
"""Trust in the 3D points for a rotation between the two sides."""

KEYPOINT_ERROR = 0.02
"""Standard deviation of a 2D keypoint, as a fraction of the body's height in the picture."""

BODY_HEIGHT_M = 1.7

WINDOW_S = 0.17
"""Frames this close to a side's last observation take part."""
MAX_FRAMES = 4
"""At most so many frames a side, spread over the window: their errors are nearly the same error."""
GAP_WARNING_S = 0.2
"""Beyond it the motion across the cut is a guess."""
CONTEMPORARY_S = 0.15
"""Who is lost for longer than this at a cut has no say beside those who are not."""
SWAPPED_STARTS = 3
"""So many starts are tried with left and right swapped."""


def viewing_axes(keypoints2d: Float[Array, "n 33 3"], K: Float[Array, "3 3"]) -> Float[Array, "n 3 3"]:
    """R_cam_ray of the ray through the body's middle (`projection.ray_axes`)."""
    torso = keypoints2d[:, [11, 12, 23, 24], :2].mean(axis=1)
    return ray_axes(viewing_rays(torso, K))


class CutMethod(Protocol):
    """Finds how the camera rotated at one cut from the people who are seen on both sides of it."""

    def __call__(
        self, people: Sequence[CutPerson], cameras: CutCameras, *, cut_frame: int, cut_time_s: float
    ) -> CutAlignment:
        """Camera axes after the cut to those before it, with its uncertainty in degrees.

        `cut_frame` is the first frame of the later shot, `cut_time_s` the moment of the cut, seconds. Where nobody is
        seen on both sides (`people` is empty) the alignment is not `linked`.
        """
        ...


def align_by_bundle(
    people: Sequence[CutPerson], cameras: CutCameras, *, cut_frame: int, cut_time_s: float
) -> CutAlignment:
    """The rotation that lets one motion through the cut explain both sides (a `CutMethod`)."""
    if not people:
        return _unlinked(cut_frame)
    people, gap, warnings = _contemporary(people, cut_frame)
    answers, sigma_ray = _adjusted(people, cameras, cut_time_s)
    swapped: list[cut_bundle.BundleResult] = []
    if len(people) == 1:
        other = CutPerson(people[0].before, people[0].after.sides_swapped())
        swapped, _ = _adjusted([other], cameras, cut_time_s, most_starts=SWAPPED_STARTS)
    hypotheses = hypotheses_of(people, answers, swapped, gap)
    focal = 0.5 * (cameras.K_before[0, 0] + cameras.K_after[0, 0])
    return CutAlignment(
        cut_frame=cut_frame,
        method="bundle",
        R_before_after=hypotheses[0].R_before_after,
        residual_px=float(answers[0].residual_px_ratio * focal * sigma_ray),
        uncertainty_deg=hypotheses[0].sigma_deg,
        gap_s=gap,
        linked=True,
        warnings=warnings,
        hypotheses=hypotheses,
    )


def _adjusted(
    people: Sequence[CutPerson], cameras: CutCameras, cut_time_s: float, *, most_starts: int | None = None
) -> tuple[list[cut_bundle.BundleResult], float]:
    """The bundle adjustments from all starts (or the first few), cheapest first, and the standard deviation of image
    points (as x/z)."""
    prepared = [_prepare(person, cameras, cut_time_s) for person in people]
    options = BundleSettings(camera_velocity_ms=0.3 if cameras.moving else 0.02)
    starts = np.concatenate([_starts(item, person) for item, person in zip(prepared, people, strict=True)])
    sigma_ray = float(np.mean([view.sigma_ray for item in prepared for view in (item.before, item.after)]))
    return cut_bundle.adjust(prepared, _BODY, _distinct(starts)[:most_starts], options), sigma_ray


def align_by_eight_point(
    people: Sequence[CutPerson], cameras: CutCameras, *, cut_frame: int, cut_time_s: float
) -> CutAlignment:
    """The paper's essential matrix from the keypoints of the two frames around the cut (a `CutMethod`)."""
    if not people:
        return _unlinked(cut_frame)
    people, gap, warnings = _contemporary(people, cut_frame)
    prepared = [_prepare(person, cameras, cut_time_s) for person in people]
    return _eight_point(prepared, cameras, cut_frame, gap, warnings)


def _unlinked(cut_frame: int) -> CutAlignment:
    return CutAlignment(cut_frame, "none", np.eye(3), float("nan"), 180.0, float("nan"), False)


def _contemporary(people: Sequence[CutPerson], cut_frame: int) -> tuple[list[CutPerson], float, tuple[str, ...]]:
    """The people who are seen close to the cut, the shortest gap in seconds, and a warning where even that is long."""
    gaps = [float(person.after.time_s[0] - person.before.time_s[-1]) for person in people]
    gap = min(gaps)
    near = [person for person, own in zip(people, gaps, strict=True) if own <= max(CONTEMPORARY_S, 1.5 * gap)]
    warning = f"cut at frame {cut_frame}: {gap:.2f} s without anyone seen, the camera's rotation across it is uncertain"
    return near, gap, (warning,) if gap > GAP_WARNING_S else ()


def continuation_cost(person: CutPerson, K: Float[Array, "3 3"]) -> float:
    """How badly one person's two sides fit one motion seen by two cameras: ½ Σ of squared normalised residuals."""
    # The cameras may move by an unknown amount: a velocity between them is allowed.
    item = _prepare(person, CutCameras(K, K, True), 0.5 * float(person.before.time_s[-1] + person.after.time_s[0]))
    starts = _distinct(_starts(item, person))
    return cut_bundle.adjust([item], _BODY, starts, BundleSettings(camera_velocity_ms=0.3))[0].cost


def _prepare(person: CutPerson, cameras: CutCameras, cut_time_s: float) -> PersonAtCut:
    before = _side(person.before, cameras.K_before, cut_time_s, last=True)
    after = _side(person.after, cameras.K_after, cut_time_s, last=False)
    points = np.concatenate([before.points, after.points])
    a, b = np.array(_BODY.bones).T
    lengths = np.median(np.linalg.norm(points[:, a] - points[:, b], axis=-1), axis=0)
    pairs = lengths[: 2 * _NUM_PAIRS].reshape(_NUM_PAIRS, 2)
    lengths[: 2 * _NUM_PAIRS] = np.repeat(pairs.mean(axis=1), 2)
    return PersonAtCut(before, after, lengths)


def _window(track: SideTrack, last: bool) -> Int[Array, "m"]:
    """At most MAX_FRAMES frames within WINDOW_S of the end that faces the cut, without those that fit no neighbour."""
    time_s = track.time_s
    near = np.flatnonzero(((time_s[-1] - time_s) if last else (time_s - time_s[0])) <= WINDOW_S + 1e-9)
    if len(near) > 3:
        # Right at a cut the pose network starts afresh and may mix up a frame or two.
        points = track.landmarks3d[near][:, list(POINTS)].astype(np.float64)
        off = np.linalg.norm(points - np.median(points, axis=0), axis=-1).mean(axis=1)
        near = near[off <= 3.0 * np.median(off) + 0.02]
    chosen = np.unique(np.round(np.linspace(0, len(near) - 1, min(MAX_FRAMES, len(near)))).astype(np.int64))
    return np.asarray(near[chosen])


def _side(track: SideTrack, K: Float[Array, "3 3"], cut_time_s: float, last: bool) -> SideView:
    frames = _window(track, last)
    keypoints = track.keypoints2d[frames].astype(np.float64)
    picked = list(POINTS)
    rays = viewing_rays(keypoints[:, picked, :2], K)
    R_cam_ray = viewing_axes(keypoints, K)
    R_cut_cam = track.R_cut_cam[frames]
    rays = np.einsum("nab,njb->nja", R_cut_cam, rays)
    points = np.einsum("nab,njb->nja", R_cut_cam @ R_cam_ray, track.landmarks3d[frames][:, picked].astype(np.float64))
    points -= points[:, list(_BODY.hips)].mean(axis=1, keepdims=True)
    image = rays[..., :2] / np.maximum(rays[..., 2:], 1e-3)
    weight = _IMAGE_WEIGHT * np.clip(keypoints[:, picked, 2], 0.0, 1.0)
    origin = np.stack([_origin(points[k], image[k], weight[k]) for k in range(len(frames))])
    sigma = KEYPOINT_ERROR * BODY_HEIGHT_M / float(np.median(origin[:, 2]))
    return SideView(track.time_s[frames] - cut_time_s, image, weight, points, origin, sigma)


def _origin(points: Float[Array, "J 3"], rays: Float[Array, "J 2"], weight: Float[Array, "J"]) -> Float[Array, "3"]:
    """Where a body with these points (about its mid-hip) stands in front of the camera, by linear least squares."""
    # (p_x + o_x) = x (p_z + o_z), the same for y: linear in the origin o.
    A = np.zeros((2 * len(points), 3))
    A[0::2, 0] = A[1::2, 1] = 1.0
    A[0::2, 2], A[1::2, 2] = -rays[:, 0], -rays[:, 1]
    b = np.stack([rays[:, k] * points[:, 2] - points[:, k] for k in (0, 1)], axis=1).ravel()
    w = np.sqrt(np.repeat(weight, 2)) + 1e-3
    origin: Array = np.linalg.lstsq(A * w[:, None], b * w, rcond=None)[0]
    origin[2] = np.clip(origin[2], 0.5, 100.0)
    return origin


def _at_cut(view: SideView) -> Float[Array, "J 3"]:
    """3D points carried to the cut by their mean motion over the window."""
    n = len(view.time_s)
    basis = np.stack([np.ones(n), view.time_s], axis=1)
    # A damped slope: noise over a short window must not be carried far.
    normal = basis.T @ basis + np.diag([0.0, 0.2 * WINDOW_S**2])
    return np.asarray(np.linalg.solve(normal, basis.T @ view.points.reshape(n, -1))[0].reshape(-1, 3))


def _starts(item: PersonAtCut, person: CutPerson) -> Float[Array, "s 3 3"]:
    before, after = _at_cut(item.before), _at_cut(item.after)
    R_people = kabsch(after, before, _ROTATION_WEIGHT)
    trunk = before[3:5].mean(axis=0)
    trunk /= max(float(np.linalg.norm(trunk)), 1e-6)
    starts = [R_people, *(rotvec_to_rotmat(trunk * angle) @ R_people for angle in np.deg2rad([-30.0, 30.0]))]
    R_body = fitted_body_rotation(person)
    if R_body is not None:
        starts.append(R_body)
    camera_after, camera_before = _pnp(before, item.after, 0), _pnp(after, item.before, -1)
    if camera_after is not None:
        starts.append(camera_after)
    if camera_before is not None:
        starts.append(camera_before.T)
    return np.stack(starts)


def _pnp(points: Float[Array, "J 3"], view: SideView, frame: int) -> Float[Array, "3 3"] | None:
    """R_points_camera: the camera that sees one side's 3D points as the other side's picture shows them."""
    seen = view.weight[frame] > 0.2
    if seen.sum() < 6:
        return None
    rays = view.rays[frame][seen]
    try:
        ok, rotvec, _ = cv2.solvePnP(points[seen], rays, np.eye(3), np.zeros(4), flags=cv2.SOLVEPNP_SQPNP)
    except cv2.error:  # rays, or points, without extent
        return None
    return rotvec_to_rotmat(np.asarray(rotvec).ravel()).T if ok else None


def _distinct(R: Float[Array, "s 3 3"]) -> Float[Array, "m 3 3"]:
    """Starts that differ by more than 8° from those before them."""
    kept: list[Array] = []
    for candidate in R:
        if all(angle_between_deg(candidate, other) > 8.0 for other in kept):
            kept.append(candidate)
    return np.stack(kept)


def _eight_point(
    prepared: Sequence[PersonAtCut],
    cameras: CutCameras,
    cut_frame: int,
    gap: float,
    warnings: tuple[str, ...],
) -> CutAlignment:
    visible = [(item.before.weight[-1] > 0.1) & (item.after.weight[0] > 0.1) for item in prepared]
    first = np.concatenate([item.before.rays[-1][seen] for item, seen in zip(prepared, visible, strict=True)])
    second = np.concatenate([item.after.rays[0][seen] for item, seen in zip(prepared, visible, strict=True)])
    sigma = float(np.mean([view.sigma_ray for item in prepared for view in (item.before, item.after)]))
    view = epipolar.eight_point_pose(first, second, threshold=1.5 * sigma)
    focal = 0.5 * (cameras.K_before[0, 0] + cameras.K_after[0, 0])
    if view is None:
        message = f"cut at frame {cut_frame}: {len(first)} keypoints are seen on both sides, eight are needed"
        return CutAlignment(cut_frame, "none", np.eye(3), float("nan"), 180.0, gap, False, (*warnings, message))
    R = nearest_rotation(view.R_before_after)
    return CutAlignment(cut_frame, "eight-point", R, float(view.residual * focal), 45.0, gap, True, warnings)
