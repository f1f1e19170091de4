"""Visual odometry over the keyframes of a shot (paper section 3.2): windowed bundle adjustment as the shot goes on,
then all.

Two runs share it. `rotating` lets the camera only rotate (points at infinity). `moving` starts from a two-view pose,
then takes one keyframe after the other: pose against the known points, new points, adjustment of the last few
keyframes.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from humanmm.models.camera.odometry.bundle import Adjusted, Freedom, Observations, Points, Views, adjust, residuals
from humanmm.models.camera.odometry.resection import resect
from humanmm.models.camera.odometry.tracked_shot import TrackedShot
from humanmm.models.camera.odometry.two_view import Pair, five_point_pose, rays, starting_pairs, wahba_rotation
from humanmm.models.geometry import rotations
from humanmm.models.video.progress import Progress, silent

WINDOW = 15
"""Keyframes in an adjustment while the odometry runs (LEAP-VO: 15)."""
WINDOW_STEP = 5
"""Keyframes taken between two adjustments."""
MAX_GLOBAL_KEYFRAMES = 100
"""Longer shots keep the windowed result: the last adjustment over all keyframes would grow with the cube of their
number."""
EXACT_FRACTION = 0.0003
"""A camera that fits within this fraction of the diagonal (standard deviation) needs no other explanation."""
MAX_ERROR_FRACTION = 0.002
"""Error of a sighting, as a fraction of the diagonal, that the two-view pose at the start tolerates."""
LASTING, MIN_LASTING = 4, 100
"""Keyframes that see a point that counts in comparing models, and sightings of such points needed."""
OUTLIER_SIGMA = 4.0
"""Sightings off by more standard deviations than this after an adjustment are dropped (LEAP-VO: above 5 px)."""
IMAGES_AT_ONCE = 200
MIN_POINTS = 12
"""Fewer background points in a keyframe than this cannot carry a pose."""


@dataclass(frozen=True)
class Track:
    """A camera track over keyframes with the map it was made with."""

    keyframes: Int[np.ndarray, " k"]
    views: Views
    points: Points
    known: Bool[np.ndarray, " p"]
    """Points that are part of the map."""
    adjusted: Adjusted
    observations: Observations
    """What the last adjustment used, image numbers into `keyframes`."""
    all_sightings: Observations
    """All keyframe sightings of points seen from two keyframes, outliers included."""

    @property
    def held(self) -> Bool[np.ndarray, " k"]:
        """The first keyframe, whose pose and zoom an adjustment of the track keeps."""
        return np.asarray(np.arange(len(self.keyframes)) == 0)

    @property
    def error_px(self) -> float:
        """Median reprojection error over all lasting points (if there are any), whether the map was fitted to them or
        not.

        A point seen twice fits any moving camera; only one seen more often distinguishes models.
        """
        residual_px = residuals(self.views, self.points, self.all_sightings)
        lasting = np.bincount(self.all_sightings.point)[self.all_sightings.point] >= LASTING
        return float(np.median(residual_px[lasting] if lasting.sum() >= MIN_LASTING else residual_px))

    @property
    def lasting(self) -> Bool[np.ndarray, " p"]:
        """Points of the map that count in comparing models."""
        seen = np.bincount(self.all_sightings.point, minlength=len(self.known))
        return np.asarray(self.known & (seen >= LASTING))


def empty_points(num_points: int) -> Points:
    """Points not placed yet."""
    forward = np.tile([0.0, 0.0, 1.0], (num_points, 1))
    return Points(forward, np.zeros(num_points), np.zeros((num_points, 3)))


def rotating(shot: TrackedShot, keyframes: Int[np.ndarray, " k"], focal_px: float, *, freedom: Freedom) -> Track:
    """The track of a camera that only rotates (and zooms, if `freedom` says so)."""
    num_keyframes = len(keyframes)
    views = _static(num_keyframes, focal_px)
    points = empty_points(shot.num_points)
    known = np.zeros(shot.num_points, bool)
    observations = shot.of_images(keyframes)
    begins = np.searchsorted(observations.image, np.arange(num_keyframes + 1))
    for k in range(num_keyframes):
        part = slice(begins[k], begins[k + 1])
        point, xy = observations.point[part], observations.xy[part]
        ray = rays(xy, views.focals_px[k])
        old = known[point]
        if k > 0:
            views.R_shot_cam[k] = wahba_rotation(points.direction[point[old]], ray[old], views.R_shot_cam[k - 1])
            if freedom.zoom:
                views.log_zoom[k] = views.log_zoom[k - 1]
        points.direction[point[~old]] = rays(xy[~old], views.focals_px[k]) @ views.R_shot_cam[k].T
        known[point] = True
        if k + 1 < num_keyframes and k >= WINDOW_STEP and k % WINDOW_STEP == 0:
            _adjust_window(views, points, observations, begins, k + 1, freedom)
    final = _adjust_all(views, points, observations, num_keyframes, freedom)
    return Track(keyframes, final.views, final.points, known, final, observations, _seen_twice(observations))


def _seen_twice(observations: Observations) -> Observations:
    return observations.select(np.bincount(observations.point)[observations.point] >= 2)


def moving(shot: TrackedShot, guide: Track, *, max_starts: int = 3, progress: Progress = silent) -> Track | None:
    """The track of a camera that moves, over the keyframes of `guide`, which predicts its rotations.

    A two-view pose from noisy points may be the wrong one of several that look alike; while the result does not fit as
    points normally do, up to `max_starts` pairs are tried, and the best fit wins. None if no pair gives a start.
    """
    best: Track | None = None
    for pair in starting_pairs(shot, guide.keyframes, guide.views.focal_px)[:max_starts]:
        run = _MovingRun(shot, guide.keyframes, guide)
        if not run.start(pair, MAX_ERROR_FRACTION * shot.diagonal_px):
            continue
        for k in range(pair.second + 1, len(guide.keyframes)):
            run.take(k, k - 1)
            progress(int(run.placed.sum()), len(run.placed))
        for k in range(pair.first - 1, -1, -1):
            run.take(k, k + 1)
            progress(int(run.placed.sum()), len(run.placed))
        track = run.finish()
        if best is None or track.error_px < best.error_px:
            best = track
        if best.error_px < EXACT_FRACTION * shot.diagonal_px:
            break
    return best


class _MovingRun:
    """The state of the odometry of a moving camera: views of the keyframes, points, and which of both are known."""

    def __init__(self, shot: TrackedShot, keyframes: np.ndarray, guide: Track) -> None:
        self.keyframes, self.guide = keyframes, guide
        self.freedom = Freedom(translation=True)
        self.observations = shot.of_images(keyframes)
        self.begins = np.searchsorted(self.observations.image, np.arange(len(keyframes) + 1))
        self.views = _static(len(keyframes), guide.views.focal_px)
        self.points = empty_points(shot.num_points)
        self.host = np.full(shot.num_points, -1)
        """Keyframe in which a point was first placed."""
        self.known = np.zeros(shot.num_points, bool)
        """Points seen from two placed keyframes."""
        self.placed = np.zeros(len(keyframes), bool)

    def seen(self, k: int) -> tuple[np.ndarray, np.ndarray]:
        part = slice(self.begins[k], self.begins[k + 1])
        return self.observations.point[part], self.observations.xy[part]

    def start(self, pair: Pair, max_error_px: float) -> bool:
        """Find the poses of the two keyframes of the pair and all between them; False if no two-view pose is found."""
        point_a, xy_a = self.seen(pair.first)
        point_b, xy_b = self.seen(pair.second)
        _, in_a, in_b = np.intersect1d(point_a, point_b, assume_unique=True, return_indices=True)
        pose = five_point_pose(xy_a[in_a], xy_b[in_b], self.views.focal_px, max_error_px=max_error_px)
        if pose is None:
            return False
        self.views.R_shot_cam[pair.second], self.views.t_shot_cam[pair.second] = pose
        self._see(pair.first)
        self._see(pair.second)
        self._adjust(np.array([pair.first, pair.second]), num_fixed=1)
        for k in range(pair.first + 1, pair.second):
            fraction = (k - pair.first) / (pair.second - pair.first)
            R = self.guide.views.R_shot_cam
            self.views.R_shot_cam[k] = self.views.R_shot_cam[k - 1] @ R[k - 1].T @ R[k]
            self.views.t_shot_cam[k] = fraction * self.views.t_shot_cam[pair.second]
            self._resect(k)
            self._see(k)
        self._adjust(np.arange(pair.first, pair.second + 1), num_fixed=1)
        return True

    def take(self, k: int, neighbour: int) -> None:
        """Find the pose of keyframe k, next to a known one: predicted rotation and damped velocity, resection, new
        points, adjustment of the window."""
        R = self.guide.views.R_shot_cam
        self.views.R_shot_cam[k] = self.views.R_shot_cam[neighbour] @ R[neighbour].T @ R[k]
        before = 2 * neighbour - k
        velocity = 0.0
        if 0 <= before < len(self.placed) and self.placed[before]:
            velocity = 0.5 * (self.views.t_shot_cam[neighbour] - self.views.t_shot_cam[before])
        self.views.t_shot_cam[k] = self.views.t_shot_cam[neighbour] + velocity
        self._resect(k)
        self._see(k)
        if self.placed.sum() % WINDOW_STEP == 0:
            placed = np.flatnonzero(self.placed)
            window = placed[-WINDOW:] if k > neighbour else placed[:WINDOW][::-1]
            self._adjust(window, num_fixed=1 if len(window) < WINDOW else WINDOW // 3)

    def _resect(self, k: int) -> None:
        point, xy = self.seen(k)
        use = self.known[point]
        one = _views_of(self.views, np.array([k]))
        sightings = Observations(np.zeros(int(use.sum()), int), point[use], xy[use])
        refined, _, enough = resect(one, self.points, sightings, freedom=self.freedom, iterations=8)
        if enough[0]:
            self.views.R_shot_cam[k], self.views.t_shot_cam[k] = refined.R_shot_cam[0], refined.t_shot_cam[0]

    def _see(self, k: int) -> None:
        """Note the points of a placed keyframe: new ones get a direction, those seen the second time a distance."""
        point, xy = self.seen(k)
        self.placed[k] = True
        direction = rays(xy, self.views.focal_px) @ self.views.R_shot_cam[k].T
        new = self.host[point] < 0
        around = point[self.known[point]]
        usual = float(np.median(self.points.rho[around])) if len(around) else 1.0
        self.host[point[new]] = k
        self.points.direction[point[new]] = direction[new]
        self.points.anchor[point[new]] = self.views.t_shot_cam[k]
        self.points.rho[point[new]] = usual
        second = ~new & ~self.known[point]
        again = point[second]
        rho, sure = _inverse_depth(self.points.direction[again], self.points.anchor[again], self.views, k, xy[second])
        usual = float(np.median(rho[sure])) if not len(around) and sure.any() else usual
        self.points.rho[again] = np.where(sure, np.clip(rho, 0.0, 20.0 * usual), usual)
        self.known[again] = True

    def _adjust(self, images: np.ndarray, *, num_fixed: int) -> None:
        """Adjust some placed keyframes, oldest first, of which the first `num_fixed` stay."""
        parts = [np.arange(self.begins[k], self.begins[k + 1]) for k in images]
        index = np.concatenate(parts)
        number = np.repeat(np.arange(len(images)), [len(part) for part in parts])
        keep = self.known[self.observations.point[index]]
        seen = Observations(number[keep], self.observations.point[index[keep]], self.observations.xy[index[keep]])
        fixed = np.arange(len(images)) < num_fixed
        _adjust_part(self.views, self.points, images, seen, fixed, freedom=self.freedom, iterations=6)

    def finish(self) -> Track:
        """Adjust everything, the second time without outliers, and make the first keyframe the frame of the shot."""
        sightings = self.observations.select(self.known[self.observations.point])
        result, sightings = _adjust_twice(self.views, self.points, sightings, len(self.keyframes), self.freedom)
        result = _from_first_view(result)
        known = self.known & (np.bincount(sightings.point, minlength=len(self.known)) >= 2)
        everything = _seen_twice(self.observations)
        return Track(self.keyframes, result.views, result.points, known, result, sightings, everything)


def _inverse_depth(
    direction: np.ndarray, anchor: np.ndarray, views: Views, k: int, xy: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Least-squares ρ of points with known direction from their sighting in view k, and where it means something.

    From x q_z = q_xy with q = a + ρ b, a = Rᵀ direction, b = Rᵀ (anchor − t): two linear equations in ρ.
    """
    R_cam_shot = views.R_shot_cam[k].T
    a, b = direction @ R_cam_shot.T, (anchor - views.t_shot_cam[k]) @ R_cam_shot.T
    x = xy / views.focals_px[k]
    slope = x * b[:, 2:] - b[:, :2]
    offset = a[:, :2] - x * a[:, 2:]
    strength = (slope**2).sum(1)
    rho = (slope * offset).sum(1) / np.maximum(strength, 1e-12)
    parallax = views.focals_px[k] * np.sqrt(strength) * np.abs(rho)
    return rho, (rho > 0) & (parallax > 2.0)


def _from_first_view(result: Adjusted) -> Adjusted:
    """The same solution in the axes of its first view."""
    R, t = result.views.R_shot_cam[0], result.views.t_shot_cam[0]
    views = replace(
        result.views, R_shot_cam=R.T @ result.views.R_shot_cam, t_shot_cam=(result.views.t_shot_cam - t) @ R
    )
    points = Points(result.points.direction @ R, result.points.rho, (result.points.anchor - t) @ R)
    return replace(result, views=views, points=points)


def moving_and_zooming(
    shot: TrackedShot,
    keyframes: Int[np.ndarray, " k"],
    focal_px: float,
    log_zoom: Float[np.ndarray, " k"],
    *,
    max_starts: int = 3,
    progress: Progress = silent,
) -> Track | None:
    """The track of a camera that moves and zooms; `focal_px` is that of the first keyframe. None as of `moving`.

    Zoom and travel look much alike: the valley between them is long and flat, and an adjustment that starts from travel
    alone stays at its end. So the zoom of a camera that only rotates (`log_zoom`, from `rotating`) is taken out of the
    pictures first; what travel is left is found as that of a constant lens, and then both are adjusted together. The
    zoom of a camera that does not zoom comes out near zero.
    """
    of_image = np.interp(np.arange(shot.num_images), keyframes, log_zoom - log_zoom[0])
    sightings = shot.sightings
    xy = sightings.xy * np.exp(-of_image)[sightings.image, None]
    unzoomed = replace(shot, sightings=replace(sightings, xy=xy.astype(sightings.xy.dtype)))
    guide = rotating(unzoomed, keyframes, focal_px, freedom=Freedom(translation=False))
    moved = moving(unzoomed, guide, max_starts=max_starts, progress=progress)
    if moved is None:
        return None
    views = replace(moved.views, log_zoom=log_zoom - log_zoom[0])
    seen = shot.of_images(keyframes)
    freedom = Freedom(translation=True, zoom=True)
    used = seen.select(moved.known[seen.point])
    result, used = _adjust_twice(views, moved.points, used, len(keyframes), freedom)
    known = moved.known & (np.bincount(used.point, minlength=len(moved.known)) >= 2)
    return Track(keyframes, result.views, result.points, known, result, used, _seen_twice(seen))


def _static(num_images: int, focal_px: float) -> Views:
    return Views(np.tile(np.eye(3), (num_images, 1, 1)), np.zeros((num_images, 3)), np.zeros(num_images), focal_px)


def _adjust_window(
    views: Views, points: Points, observations: Observations, begins: np.ndarray, stop: int, freedom: Freedom
) -> None:
    """Adjust the keyframes [stop − WINDOW, stop) and what they see, in place; those before the window's last
    third of overlap stay fixed."""
    first = max(0, stop - WINDOW)
    part = slice(begins[first], begins[stop])
    seen = Observations(observations.image[part] - first, observations.point[part], observations.xy[part])
    fixed = np.arange(first, stop) < first + (1 if first == 0 else WINDOW // 3)
    _adjust_part(views, points, np.arange(first, stop), seen, fixed, freedom=freedom, iterations=5)


def _adjust_part(
    views: Views,
    points: Points,
    images: np.ndarray,
    seen: Observations,
    fixed: np.ndarray,
    *,
    freedom: Freedom,
    iterations: int,
) -> None:
    """Adjust some keyframes and the points that they see, in place; `seen` counts the images from the first of them."""
    used, point = np.unique(seen.point, return_inverse=True)
    local = Observations(seen.image, point, seen.xy)
    window = _views_of(views, images)
    result = adjust(window, points.select(used), local, fixed=fixed, freedom=freedom, iterations=iterations)
    views.R_shot_cam[images] = result.views.R_shot_cam
    views.t_shot_cam[images] = result.views.t_shot_cam
    views.log_zoom[images] = result.views.log_zoom
    _put(points, used, result.points)


def _views_of(views: Views, images: np.ndarray) -> Views:
    return Views(views.R_shot_cam[images], views.t_shot_cam[images], views.log_zoom[images], views.focal_px)


def _put(points: Points, index: np.ndarray, values: Points) -> None:
    """Write the values into some of the points."""
    points.direction[index], points.rho[index], points.anchor[index] = values.direction, values.rho, values.anchor


def _adjust_all(
    views: Views, points: Points, observations: Observations, num_keyframes: int, freedom: Freedom
) -> Adjusted:
    """The last adjustment, over all keyframes; a long shot keeps what its windows gave."""
    fixed = np.zeros(num_keyframes, bool)
    fixed[0] = True
    iterations = 10 if num_keyframes <= MAX_GLOBAL_KEYFRAMES else 0
    return adjust(views, points, observations, fixed=fixed, freedom=freedom, iterations=iterations)


def _adjust_twice(
    views: Views, points: Points, observations: Observations, num_keyframes: int, freedom: Freedom
) -> tuple[Adjusted, Observations]:
    """The last adjustment, repeated without its outliers; and the sightings that are left."""
    result = _adjust_all(views, points, observations, num_keyframes, freedom)
    kept = observations.select(result.residual_px < OUTLIER_SIGMA * result.noise_px)
    return _adjust_all(result.views, result.points, kept, num_keyframes, freedom), kept


def all_images(shot: TrackedShot, track: Track, *, freedom: Freedom) -> tuple[Views, Float[np.ndarray, " m"]]:
    """Views of every recorded image from the keyframes' map, and the reprojection error of every sighting used.

    The first image stays as it is: it is the frame of the shot.
    """
    at = np.arange(shot.num_images, dtype=float)
    known_at = track.keyframes.astype(float)
    views = Views(
        rotations.interpolate_rotations(at, known_at, track.views.R_shot_cam),
        np.stack([np.interp(at, known_at, track.views.t_shot_cam[:, axis]) for axis in range(3)], 1),
        np.interp(at, known_at, track.views.log_zoom),
        track.views.focal_px,
    )
    residuals_px = []
    for first in range(0, shot.num_images, IMAGES_AT_ONCE):
        images = np.arange(first, min(first + IMAGES_AT_ONCE, shot.num_images))
        sightings = shot.of_images(images)
        sightings = sightings.select(track.known[sightings.point] & ((sightings.image > 0) | (first > 0)))
        part, residual_px, _ = resect(_views_of(views, images), track.points, sightings, freedom=freedom)
        views.R_shot_cam[images], views.t_shot_cam[images] = part.R_shot_cam, part.t_shot_cam
        views.log_zoom[images] = part.log_zoom
        residuals_px.append(residual_px)
    return views, np.concatenate(residuals_px)
