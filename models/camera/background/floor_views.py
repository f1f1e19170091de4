"""The floor of a place as two cameras see it, both from straight above, and how the cameras stand to each other by it.

A floor is the one surface that all cameras of a place have in view. Rectified by the vertical and by the camera's
height above it (inverse perspective mapping: Mallot, Bülthoff, Little and Bohrer, Biological Cybernetics 1991) it looks
the same from any side, up to a rotation about the vertical: features (SIFT, Lowe 2004) match from opposite sides of a
room, where those of the pictures themselves do not. Two matches give the cameras' heading and the way between them.
Tiles match their neighbours too: how alike both floors are all over what both show (their correlation) tells of that.
"""

import math
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8
from scipy.optimize import least_squares

from humanmm.models.camera.background.frame_edges import match_features
from humanmm.models.camera.background.ground import HIDDEN
from humanmm.models.camera.background.keyframes import roots_of
from humanmm.models.geometry.projection import viewing_rays
from humanmm.models.geometry.robust import cauchy_loss
from humanmm.models.geometry.rotations import rotvec_to_rotmat, unit

Array = np.ndarray

CELL_M = 0.015
"""Side of a pixel of the floor seen from above, metres; larger where the floor in view is."""
MOST_SIDE_PX = 1400
FARTHEST_M, LEAST_DEPRESSION_DEG = 8.0, 8.0
"""The floor is looked at so far from the point below the camera, and where viewing rays meet it under this angle."""
EVERY_PX = 4
"""Whether the floor is seen is asked of so many pixels' middle."""
LEAST_SHARE, LEAST_SIDE_PX = 0.02, 24
"""Of the picture that must show the floor, and of the floor seen from above."""
MAX_FEATURES, CONTRAST = 1500, 0.005
"""Strongest features, and the least contrast: floors are plain."""
BESIDE_PX = 3
"""Nothing is looked at so near to people and to the edge of what is seen."""
RATIO = 0.95
"""Lowe's ratio test. One motion of the whole floor decides, so that it may be lenient."""
LEAST_INLIERS = 3
APART_M = 0.3
"""Two matches that give a motion are farther apart than this."""
LOG_SCALE = 0.2
"""How differently two shots may be scaled: their cameras' heights above the floor follow from people's sizes."""
TURN_RAD = 0.5
"""Error of a feature's own direction."""
PLACE_M, PLACE_SHARE = 0.06, 0.03
"""How far a match may be off, metres, and in shares of its distance from the camera."""
MOST_PAIRS, MOST_STARTS = 30_000, 1000
"""Pairs of matches that are looked at, and motions by them that are counted for: spread evenly over all there are."""
REFINED, ITERATIONS = 40, 4
"""Motions, those with most matches, that are settled over all their matches, in so many steps."""
POINT_M, POINT_SHARE, SCALE_SIGMA = 0.03, 0.015, 0.1
"""Error of a right match, metres and in shares of its distance; of the logarithm of the shots' relative scale."""
CELL_OF_INLIERS_M = 0.1
"""Matches that lie closer together are one: an edge of a tile has many."""
DISTINCT_DEG, MOST_MOTIONS = 10.0, 4
"""Motions whose headings are closer are one, and so many are told of."""
PATTERN_M, NEIGHBOURHOOD_PX, NOISE = 0.05, 8.0, 2.0
"""Side of a pixel of the floor's pattern, the pixels against which its brightness is taken, and the grey levels that
are the sensor's."""
LEAST_COMMON_PX = 150
"""Of the patterns of two floors, to compare them."""


@dataclass(frozen=True, eq=False)
class FloorFeatures:
    """Features of the floor as one frame shows it, from above."""

    xy: Float[Array, "n 2"]
    """Level axes about the point below the camera, metres."""
    direction: Float[Array, " n"]
    """Of the feature's own axis in them, radians."""
    roots: Float[Array, "n 128"]
    """See `roots_of`."""
    pattern: "FloorPattern"


@dataclass(frozen=True, eq=False)
class FloorPattern:
    """How bright a floor is against its surroundings, in cells of PATTERN_M from above: x along rows, y up columns."""

    corner: Float[Array, "2"]
    """x and y of the first pixel's centre, level axes about the point below the camera, metres."""
    contrast: Float[Array, "rows columns"]
    """float32, in standard deviations of the neighbourhood; 0 where nothing is seen."""
    shown: UInt8[Array, "rows columns"]
    """1 where the floor is seen."""

    @classmethod
    def of(
        cls, above: UInt8[Array, "h w"], shown: UInt8[Array, "h w"], cell: float, corner: Float[Array, "2"]
    ) -> "FloorPattern":
        """From a picture from above with pixels of `cell` metres, the first one's centre at `corner`."""
        size = tuple(max(1, int(side * cell / PATTERN_M)) for side in shown.shape[::-1])
        bright, seen = (
            cv2.resize(one.astype(np.float32), size, interpolation=cv2.INTER_AREA) for one in (above * shown, shown)
        )
        whole = (seen > 1 - 1e-3).astype(np.float32)

        def around(values: Array) -> Array:
            of_all = cv2.GaussianBlur(whole, (0, 0), NEIGHBOURHOOD_PX) + np.float32(1e-6)
            return np.asarray(cv2.GaussianBlur(values * whole, (0, 0), NEIGHBOURHOOD_PX) / of_all)

        off = (bright - around(bright)) * whole
        contrast = off / (np.sqrt(around(off**2)) + np.float32(NOISE))
        first = corner + 0.5 * (PATTERN_M - cell) * np.array([1.0, -1.0])
        return cls(first, contrast.astype(np.float32), whole.astype(np.uint8))

    @property
    def to_level(self) -> Float[Array, "3 3"]:
        """Column and row to x and y."""
        return np.array([[PATTERN_M, 0, self.corner[0]], [0, -PATTERN_M, self.corner[1]], [0, 0, 1]])


@dataclass(frozen=True)
class FloorMotion:
    """How frame b's floor lies in frame a's: p_a = scale · R(heading) p_b + shift."""

    num_inliers: int
    """Matches that agree, those closer than CELL_OF_INLIERS_M counted once."""
    heading: float
    """Radians about the vertical."""
    scale: float
    shift: Float[Array, "2"]
    """Where the point below camera b lies, metres of frame a."""
    correlation: float = 0.0
    """Of the patterns of both floors where they overlap, -1 to 1; 0 where they hardly do."""
    points: Float[Array, "2 k 2"] = field(default_factory=lambda: np.zeros((2, 0, 2)))
    """The matches that agree, in frame a and in frame b."""

    def is_like(self, other: "FloorMotion") -> bool:
        """Whether both have about the same heading."""
        turned = math.remainder(self.heading - other.heading, 2 * math.pi)
        return abs(turned) <= math.radians(DISTINCT_DEG)


def floor_features(
    gray: UInt8[Array, "height width"], K: Float[Array, "3 3"], R_level_cam: Float[Array, "3 3"], height: float
) -> FloorFeatures | None:
    """Features of the floor in one picture, HIDDEN where people are; None where too little of it is seen.

    `R_level_cam`: camera axes to level axes, z up; `height`: of the camera above the floor, metres.
    """
    seen, xy = _on_floor(gray.shape, K, R_level_cam, height)
    if seen.mean() < LEAST_SHARE:
        return None
    low, high = xy.min(axis=0), xy.max(axis=0)
    cell = max(CELL_M, float((high - low).max()) / MOST_SIDE_PX)
    size = tuple(int(side) + 1 for side in (high - low) / cell)
    if min(size) < LEAST_SIDE_PX:
        return None
    # From above: x to the right, y upwards. OpenCV has pixels' centres at whole numbers.
    on_floor = np.array([[cell, 0, low[0]], [0, -cell, high[1]], [0, 0, -height]])
    to_picture = np.array([[1, 0, -0.5], [0, 1, -0.5], [0, 0, 1]]) @ K @ R_level_cam.T @ on_floor
    flags = cv2.WARP_INVERSE_MAP
    above = cv2.warpPerspective(gray, to_picture, size, flags=cv2.INTER_LINEAR | flags)
    shown = seen * (gray != HIDDEN).astype(np.uint8)
    clear = cv2.warpPerspective(shown, to_picture, size, flags=cv2.INTER_NEAREST | flags)
    clear = cv2.erode(clear, np.ones((2 * BESIDE_PX + 1, 2 * BESIDE_PX + 1), np.uint8))
    keypoints, descriptors = cv2.SIFT.create(MAX_FEATURES, contrastThreshold=CONTRAST).detectAndCompute(above, clear)
    if descriptors is None or len(keypoints) < LEAST_INLIERS:
        return None
    places = np.array([one.pt for one in keypoints]) * (cell, -cell) + (low[0], high[1])
    direction = np.radians([-one.angle for one in keypoints])
    pattern = FloorPattern.of(above, clear, cell, np.array([low[0], high[1]]))
    return FloorFeatures(places, direction, roots_of(descriptors), pattern)


def _on_floor(
    shape: tuple[int, ...], K: Float[Array, "3 3"], R_level_cam: Float[Array, "3 3"], height: float
) -> tuple[UInt8[Array, "height width"], Float[Array, "n 2"]]:
    """Which pixels look at the floor steeply and nearby (1), and where some of them meet it."""
    rows, columns = (np.arange(0.5 * EVERY_PX, side + EVERY_PX, EVERY_PX) for side in shape)
    pixels = np.stack(np.meshgrid(columns, rows), axis=-1)
    rays = unit(viewing_rays(pixels.reshape(-1, 2), K)) @ R_level_cam.T
    down = -rays[:, 2]
    seen = down > max(math.sin(math.radians(LEAST_DEPRESSION_DEG)), height / math.hypot(height, FARTHEST_M))
    coarse = seen.reshape(len(rows), len(columns)).astype(np.uint8)
    whole = np.repeat(np.repeat(coarse, EVERY_PX, axis=0), EVERY_PX, axis=1)[: shape[0], : shape[1]]
    return whole, rays[seen, :2] * (height / down[seen, None])


def floor_motions(a: FloorFeatures, b: FloorFeatures) -> tuple[FloorMotion, ...]:
    """The motions that matches of two frames' floors agree on, at most MOST_MOTIONS, the best first."""
    index_a, index_b = match_features(a.roots, b.roots, ratio=RATIO)
    if len(index_a) < LEAST_INLIERS:
        return ()
    matches = _Matches(a.xy[index_a], b.xy[index_b], a.direction[index_a] - b.direction[index_b])
    found: list[FloorMotion] = []
    for heading, scale, shift in matches.started():
        motion = matches.settled(heading, scale, shift)
        if motion is not None and not any(motion.is_like(other) for other in found):
            found.append(replace(motion, correlation=_correlation(a.pattern, b.pattern, motion)))
        if len(found) == MOST_MOTIONS:
            break
    return tuple(sorted(found, key=lambda motion: -motion.num_inliers))


def _correlation(a: FloorPattern, b: FloorPattern, motion: FloorMotion) -> float:
    """See `FloorMotion.correlation`."""
    a_from_b = np.eye(3)
    a_from_b[:2, :2], a_from_b[:2, 2] = _turns(np.array(motion.heading), np.array(motion.scale)), motion.shift
    moved = (np.linalg.inv(a.to_level) @ a_from_b @ b.to_level)[:2]
    size = a.shown.shape[::-1]
    common = (cv2.warpAffine(b.shown, moved, size, flags=cv2.INTER_NEAREST) > 0) & (a.shown > 0)
    if common.sum() < LEAST_COMMON_PX:
        return 0.0
    of_a, of_b = a.contrast[common], cv2.warpAffine(b.contrast, moved, size, flags=cv2.INTER_LINEAR)[common]
    of_a, of_b = of_a - of_a.mean(), of_b - of_b.mean()
    return float(of_a @ of_b / max(float(np.linalg.norm(of_a) * np.linalg.norm(of_b)), 1e-9))


def floor_rotation(
    motion: FloorMotion, heights: tuple[float, float], tilt_sigmas_rad: tuple[float, float]
) -> tuple[Float[Array, "3 3"], float]:
    """R_a_b between the level axes of both frames, and its standard deviation about one axis, radians (mean of three):
    least squares over a motion's matches, if both verticals may be a little wrong.

    A vertical that is off by a degree moves the floor six metres away from a camera at eye level by 40 cm, so that the
    matches correct it as far as they are many and spread out. `heights`: of the cameras above the floor, metres;
    `tilt_sigmas_rad`: standard deviations of the verticals about each level axis.
    """
    sigma = POINT_M + POINT_SHARE * np.linalg.norm(motion.points, axis=-1).max(axis=0)

    def of(unknown: Float[Array, "8"]) -> Float[Array, " m"]:
        on_a, on_b = (
            _tilted(points, height, unknown[2 * k : 2 * k + 2])
            for k, (points, height) in enumerate(zip(motion.points, heights, strict=True))
        )
        off = (on_a - on_b @ _turns(unknown[4], np.exp(unknown[5])).T - unknown[6:]) / sigma[:, None]
        away = np.linalg.norm(off, axis=1, keepdims=True)
        robust = np.sqrt(cauchy_loss(away**2)) / np.maximum(away, 1e-9)
        tilts = unknown[:4].reshape(2, 2) / np.array(tilt_sigmas_rad)[:, None]
        return np.concatenate([(robust * off).ravel(), tilts.ravel(), unknown[5:6] / SCALE_SIGMA])

    start = np.array([0, 0, 0, 0, motion.heading, np.log(motion.scale), *motion.shift])
    found = least_squares(of, start, method="lm", max_nfev=200)
    J = np.asarray(found.jac)
    covariance = np.linalg.inv(J.T @ J + 1e-9 * np.eye(8))
    R_tilt_a, R_tilt_b = _tilt(found.x[:2]), _tilt(found.x[2:4])
    R_turn = rotvec_to_rotmat(np.array([0.0, 0.0, found.x[4]]))
    # A small rotation of the result: minus a's tilt, the heading, and b's tilt carried over.
    by_unknown = np.zeros((3, 8))
    by_unknown[:2, :2], by_unknown[:, 2:4], by_unknown[2, 4] = -np.eye(2), R_turn[:, :2], 1.0
    variance = float(np.trace(by_unknown @ covariance @ by_unknown.T)) / 3
    return R_tilt_a.T @ R_turn @ R_tilt_b, math.sqrt(variance)


def _tilt(about: Float[Array, "2"]) -> Float[Array, "3 3"]:
    return rotvec_to_rotmat(np.array([*about, 0.0]))


def _tilted(points: Float[Array, "k 2"], height: float, about: Float[Array, "2"]) -> Float[Array, "k 2"]:
    """Points of the floor as they lie if the vertical is another."""
    rays = np.column_stack([points, np.full(len(points), -height)]) @ _tilt(about).T
    return np.asarray(rays[:, :2] * (height / np.maximum(-rays[:, 2:], 1e-3 * height)))


@dataclass(frozen=True, eq=False)
class _Matches:
    """Matches of two floors, one of which is to be moved onto the other."""

    a: Float[Array, "n 2"]
    """Places on the first floor, metres from the point below its camera."""
    b: Float[Array, "n 2"]
    """The places that they match on the second, in the same way; these are moved."""
    turn: Float[Array, " n"]
    """By how much each feature's own direction has turned from b to a, radians."""

    @property
    def tolerance(self) -> Float[Array, " n"]:
        away = np.maximum(np.linalg.norm(self.a, axis=1), np.linalg.norm(self.b, axis=1))
        return np.asarray(PLACE_M + PLACE_SHARE * away)

    def started(self) -> list[tuple[float, float, Float[Array, "2"]]]:
        """Motions by pairs of matches, those that most matches agree with first."""
        first, second = (_spread(index, MOST_PAIRS) for index in np.triu_indices(len(self.a), 1))
        of_a, of_b = self.a[second] - self.a[first], self.b[second] - self.b[first]
        length_a, length_b = np.linalg.norm(of_a, axis=1), np.linalg.norm(of_b, axis=1)
        apart = (length_a > APART_M) & (length_b > APART_M)
        heading = np.arctan2(of_a[:, 1], of_a[:, 0]) - np.arctan2(of_b[:, 1], of_b[:, 0])
        scale = length_a / np.maximum(length_b, 1e-9)
        alike = apart & (np.abs(np.log(np.maximum(scale, 1e-9))) < LOG_SCALE)
        for one in (first, second):
            alike &= np.abs(_wrapped(heading - self.turn[one])) < TURN_RAD
        kept = _spread(np.flatnonzero(alike), MOST_STARTS)
        if not len(kept):
            return []
        heading, scale, R = heading[kept], scale[kept], _turns(heading[kept], scale[kept])
        middle_a, middle_b = (0.5 * (points[first] + points[second])[kept] for points in (self.a, self.b))
        shift = middle_a - np.einsum("nab,nb->na", R, middle_b)
        off = np.linalg.norm(np.einsum("nab,mb->nma", R, self.b) + shift[:, None] - self.a, axis=-1)
        agreeing = (off < self.tolerance) & (np.abs(_wrapped(heading[:, None] - self.turn)) < TURN_RAD)
        best = np.argsort(-agreeing.sum(axis=1), kind="stable")[:REFINED]
        return [(float(heading[k]), float(scale[k]), shift[k]) for k in best]

    def agreeing(self, heading: float, scale: float, shift: Float[Array, "2"]) -> Bool[Array, " n"]:
        """The matches that a motion explains."""
        off = np.linalg.norm(self.b @ _turns(np.array(heading), np.array(scale)).T + shift - self.a, axis=1)
        return np.asarray((off < self.tolerance) & (np.abs(_wrapped(heading - self.turn)) < TURN_RAD))

    def settled(self, heading: float, scale: float, shift: Float[Array, "2"]) -> FloorMotion | None:
        """The motion of least squares over all matches that agree with one (Umeyama 1991); None with too few."""
        inlier = self.agreeing(heading, scale, shift)
        for _ in range(ITERATIONS):
            if inlier.sum() < LEAST_INLIERS:
                return None
            weight = 1 / self.tolerance[inlier] ** 2
            weight /= weight.sum()
            a, b = self.a[inlier], self.b[inlier]
            middle_a, middle_b = weight @ a, weight @ b
            a, b = a - middle_a, b - middle_b
            heading = float(np.arctan2(weight @ (b[:, 0] * a[:, 1] - b[:, 1] * a[:, 0]), weight @ (a * b).sum(axis=1)))
            scale = float(np.sqrt((weight @ a**2).sum() / max((weight @ b**2).sum(), 1e-12)))
            shift = middle_a - _turns(np.array(heading), np.array(scale)) @ middle_b
            before, inlier = inlier, self.agreeing(heading, scale, shift)
            if (before == inlier).all():
                break
        counted = min(
            len(np.unique((points[inlier] / CELL_OF_INLIERS_M).round(), axis=0)) for points in (self.a, self.b)
        )
        if counted < LEAST_INLIERS or abs(math.log(scale)) > LOG_SCALE:
            return None
        return FloorMotion(counted, heading, scale, shift, points=np.stack([self.a[inlier], self.b[inlier]]))


def _spread(values: Int[Array, " n"], most: int) -> Int[Array, " m"]:
    """At most so many of them, evenly spread."""
    return values if len(values) <= most else values[np.linspace(0, len(values) - 1, most).astype(int)]


def _turns(heading: Float[Array, "*n"], scale: Float[Array, "*n"]) -> Float[Array, "*n 2 2"]:
    c, s = scale * np.cos(heading), scale * np.sin(heading)
    return np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)


def _wrapped(angle: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """To ±π."""
    return np.asarray((angle + math.pi) % (2 * math.pi) - math.pi)
