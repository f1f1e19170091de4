"""An independent answer for the camera inside a shot: pycolmap's two-view geometry and its bundle adjustment.

The two views are distant key frames, so that what adds up along the shot shows. The bundle adjustment (Ceres, points in
Euclidean coordinates) starts from our result and is given all sightings, also those that ours dropped: where our
adjustment stopped short of the optimum, or where the optimum depends on what is called an outlier, it walks away. It
knows no camera that only rotates (its camera centres are always free), so there the two views, by their homography, are
all there is.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from humanmm.models.camera.odometry.bundle import Observations, Views
from humanmm.models.camera.odometry.colmap import pycolmap
from humanmm.models.camera.odometry.keyframe_odometry import Track
from humanmm.models.camera.odometry.tracked_shot import TrackedShot
from humanmm.models.camera.odometry.two_view import five_point_pose
from humanmm.models.geometry import rotations
from humanmm.models.geometry.alignment import umeyama_alignment
from humanmm.models.records.camera import CrossCheck

NUM_PAIRS = 4
MIN_SHARED = 40
MAX_STRETCH = 20
"""Key frames in one bundle adjustment; a shot with more is checked at its beginning, middle and end, so that the check
costs no more for a longer shot."""
POINTS_AN_IMAGE = 60
"""Of every key frame, so many points are adjusted: those seen most often."""
MIN_AN_IMAGE = 12
MIN_SIGHTINGS = 3
FARTHEST = 1e3
"""Points without parallax are put this many times the camera's path away."""
MAX_ITERATIONS = 50
MAX_DISAGREEMENT_DEG = 3.0
MAX_TRAVEL_DISAGREEMENT = 0.2
"""Above these the disagreement is worth a warning."""


def cross_check(shot: TrackedShot, track: Track, *, translating: bool) -> CrossCheck:
    """How far pycolmap's answers lie from the camera that was found over the key frames of `track`."""
    two_view = _two_view_deg(shot, track, translating=translating)
    if not translating:
        return CrossCheck(two_view)
    checked = [_adjusted(shot, track, stretch) for stretch in _stretches(len(track.keyframes))]
    found = np.array([one for one in checked if one is not None])
    if not len(found):
        return CrossCheck(two_view)
    bundle_deg, bundle_travel = found.max(axis=0)
    return CrossCheck(two_view, float(bundle_deg), float(bundle_travel))


def warnings_of(check: CrossCheck) -> tuple[str, ...]:
    """What a disagreement that is too large means, in words."""
    said = []
    if check.two_view_deg > MAX_DISAGREEMENT_DEG:
        said.append(f"pycolmap's two-view rotations differ by {check.two_view_deg:.1f} degrees from the adjusted ones")
    if check.bundle_deg > MAX_DISAGREEMENT_DEG or check.bundle_travel > MAX_TRAVEL_DISAGREEMENT:
        said.append(
            f"pycolmap's bundle adjustment moves the camera by {check.bundle_deg:.1f} degrees and "
            f"{100 * check.bundle_travel:.0f} % of its path: the points determine it badly"
        )
    return tuple(said)


def _two_view_deg(shot: TrackedShot, track: Track, *, translating: bool) -> float:
    """Median angle between our relative rotations and pycolmap's; nan where it has no answer.

    A moving camera is compared with the five-point essential matrix, one that only rotates with the homography K R K⁻¹.
    """
    angles = []
    tolerance = 0.002 * shot.diagonal_px
    for a, b in _distant_pairs(shot, track):
        _, xy_a, xy_b = shot.shared(int(track.keyframes[a]), int(track.keyframes[b]))
        if translating:
            focal_a, focal_b = track.views.focals_px[[a, b]]
            pose = five_point_pose(xy_a, xy_b * (focal_a / focal_b), focal_a, max_error_px=tolerance)
            theirs = None if pose is None else pose[0]
        else:
            theirs = _turn_from_homography(xy_a, xy_b, track.views, a, b, tolerance)
        if theirs is not None:
            ours = track.views.R_shot_cam[a].T @ track.views.R_shot_cam[b]
            angles.append(float(np.degrees(rotations.rotation_angle(ours.T @ theirs))))
    return float(np.median(angles)) if angles else float("nan")


def _distant_pairs(shot: TrackedShot, track: Track) -> Iterator[tuple[int, int]]:
    """Keyframe pairs as far apart as shared points allow, starting at places spread over the shot."""
    num_keyframes = len(track.keyframes)
    for a in np.unique(np.linspace(0, num_keyframes - 2, NUM_PAIRS).astype(int)):
        for b in range(num_keyframes - 1, a, -1):
            if len(shot.shared(int(track.keyframes[a]), int(track.keyframes[b]))[0]) >= MIN_SHARED:
                yield int(a), b
                break


def _turn_from_homography(
    xy_a: Float[np.ndarray, "n 2"], xy_b: Float[np.ndarray, "n 2"], views: Views, a: int, b: int, tolerance: float
) -> np.ndarray | None:
    options = pycolmap.RANSACOptions(random_seed=0, max_error=tolerance)
    found = pycolmap.estimate_homography_matrix(xy_a, xy_b, options)
    if found is None:
        return None
    K_a = np.diag([views.focals_px[a], views.focals_px[a], 1.0])
    K_b = np.diag([views.focals_px[b], views.focals_px[b], 1.0])
    R_b_a = np.linalg.inv(K_b) @ found["H"] @ K_a
    R_b_a = R_b_a / np.cbrt(np.linalg.det(R_b_a))
    return rotations.nearest_rotation(R_b_a).T


def _stretches(num_keyframes: int) -> list[Int[np.ndarray, " k"]]:
    """Neighbouring key frames to be adjusted together: all, or the shot's beginning, middle and end."""
    if num_keyframes <= MAX_STRETCH:
        return [np.arange(num_keyframes)]
    starts = np.unique(np.linspace(0, num_keyframes - MAX_STRETCH, 3).astype(int))
    return [np.arange(start, start + MAX_STRETCH) for start in starts]


def _adjusted(shot: TrackedShot, track: Track, keyframes: Int[np.ndarray, " k"]) -> tuple[float, float] | None:
    """Largest rotation in degrees, and largest translation as a fraction of the path's extent, by which pycolmap moves
    these key frames; None where too few points connect them."""
    sightings = _most_seen(shot.of_images(track.keyframes[keyframes]))
    used = np.unique(sightings.point)
    R_shot_cam, t_shot_cam = track.views.R_shot_cam[keyframes], track.views.t_shot_cam[keyframes]
    extent = float(np.linalg.norm(t_shot_cam - t_shot_cam.mean(axis=0), axis=1).max())
    if np.bincount(sightings.image, minlength=len(keyframes)).min() < MIN_AN_IMAGE or extent < 1e-9:
        return None
    distance = 1.0 / np.maximum(track.points.rho[used], 1.0 / (FARTHEST * extent))
    X = track.points.anchor[used] + track.points.direction[used] * distance[:, None]
    compact = replace(sightings, point=np.searchsorted(used, sightings.point))
    views = Views(R_shot_cam, t_shot_cam, track.views.log_zoom[keyframes], track.views.focal_px)
    R_theirs, t_theirs = _pycolmap_bundle(views, X, compact, track.adjusted.noise_px)
    rotation_deg = np.degrees(rotations.rotation_angle(np.swapaxes(R_shot_cam, 1, 2) @ R_theirs))
    aligned = umeyama_alignment(t_theirs, t_shot_cam, unique=False).apply(t_theirs)
    return float(rotation_deg.max()), float(np.linalg.norm(aligned - t_shot_cam, axis=1).max() / extent)


def _most_seen(sightings: Observations) -> Observations:
    """All sightings of those points that are, in one image or another, among the points seen most often."""
    times_seen = np.bincount(sightings.point)
    chosen = np.zeros(len(times_seen), bool)
    for image in np.unique(sightings.image):
        here = sightings.point[sightings.image == image]
        chosen[here[np.argsort(-times_seen[here], kind="stable")[:POINTS_AN_IMAGE]]] = True
    chosen &= times_seen >= MIN_SIGHTINGS
    return sightings.select(chosen[sightings.point])


def _pycolmap_bundle(
    views: Views, X: Float[np.ndarray, "p 3"], sightings: Observations, noise_px: float
) -> tuple[Float[np.ndarray, "k 3 3"], Float[np.ndarray, "k 3"]]:
    """Rotations and centres after pycolmap's adjustment; the first view stays, the second keeps the scale."""
    model = pycolmap.Reconstruction()
    config = pycolmap.BundleAdjustmentConfig()
    paths = [pycolmap.Track() for _ in X]
    for k, (R, t, focal_px) in enumerate(zip(views.R_shot_cam, views.t_shot_cam, views.focals_px, strict=True)):
        here = sightings.select(sightings.image == k)
        lens = pycolmap.Camera(model="SIMPLE_PINHOLE", width=2, height=2, params=[focal_px, 0.0, 0.0], camera_id=k + 1)
        model.add_camera_with_trivial_rig(lens)
        config.set_constant_cam_intrinsics(k + 1)
        image = pycolmap.Image(name=str(k), camera_id=k + 1, image_id=k + 1)
        image.points2D = pycolmap.Point2DList([pycolmap.Point2D(xy) for xy in here.xy])
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(pycolmap.Rotation3d(R.T), -R.T @ t))
        config.add_image(k + 1)
        for row, point in enumerate(here.point):
            paths[point].add_element(k + 1, row)
    for x, path in zip(X, paths, strict=True):
        model.add_point3D(x, path)
    config.fix_gauge(pycolmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
    options = pycolmap.BundleAdjustmentOptions(print_summary=False)
    options.ceres.loss_function_type = pycolmap.LossFunctionType.CAUCHY
    options.ceres.loss_function_scale = 2.0 * noise_px
    options.ceres.solver_options.num_threads = 1  # sums in one order: the same bytes every time
    options.ceres.solver_options.max_num_iterations = MAX_ITERATIONS
    options.ceres.solver_options.function_tolerance = 1e-6
    pycolmap.create_default_bundle_adjuster(options, config, model).solve()
    poses = [model.images[k + 1].cam_from_world() for k in range(len(views.log_zoom))]
    R_cam_shot = np.array([pose.rotation.matrix() for pose in poses])
    t_cam_shot = np.array([pose.translation for pose in poses])
    R_shot_cam = np.swapaxes(R_cam_shot, 1, 2)
    return R_shot_cam, -np.einsum("kij,kj->ki", R_shot_cam, t_cam_shot)
