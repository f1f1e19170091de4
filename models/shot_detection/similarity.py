"""How alike two small gray pictures are: as neighbours in time, and as views of one place.

Both measures ignore gain and offset, so that a flash or an exposure step is no change of scene.
"""

from dataclasses import dataclass

import cv2
import numpy as np

WINDOW_PX = 9
"""Side of the window in which pictures are correlated."""
_NOISE = 16.0
"""Grey levels squared; variance that coding noise leaves in a flat window, so that flat windows count as alike."""
SPARSE = 4
"""One of so many rows and columns says how far the whole picture is shifted."""
_UNMATCHED, TEXTURE = 0.3, 14.0
"""Below this correlation a window is not found again; grey levels of contrast from which it has texture."""
_SAME_PLACE_INLIERS = 10
"""Matches that agree on one similarity transform. Unrelated pictures reach 7, the same place 12 and more (measured);
tiles, bricks and windows, which repeat, reach 14."""
_SAME_PLACE_MATCH = 0.3
"""Then the one picture moved onto the other correlates with it by 0.41 and more; tiles on other tiles by 0.19."""


@dataclass(frozen=True)
class Motion:
    """How one picture moves into the next."""

    match: float
    """-1..1, mean local correlation once the motion is undone: about 0.8 for neighbours, below 0.2 across a cut."""
    flow: float
    """Mean displacement as a fraction of the picture's width."""
    unmatched: float
    """Fraction of the picture, 0..1, whose texture is not found again once the motion is undone."""
    shift: tuple[float, float] = (0.0, 0.0)
    """Median displacement, pixels: x to the right, y down."""


class MotionMeter:
    """Motion between pictures of one size, by dense inverse search at its fastest setting (about 0.5 ms at 192 px)."""

    def __init__(self) -> None:
        self._dense = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST)
        self._grid = np.zeros((0, 0, 2), np.float32)

    def __call__(self, before: np.ndarray, after: np.ndarray, where: np.ndarray | None = None) -> Motion:
        """Motion from one (H,W) uint8 picture to the next; `where` (H,W) bool: the part of them that is compared."""
        if before.shape[0] < 16 or before.shape[1] < 16:
            match, unmatched = _compared(before, after, where)
            return Motion(match, 0.0, unmatched)
        flow = np.zeros((*before.shape, 2), np.float32)
        self._dense.calc(before, after, flow)
        if self._grid.shape[:2] != before.shape:
            rows, columns = np.indices(before.shape, dtype=np.float32)
            self._grid = np.stack([columns, rows], axis=-1)
        target = self._grid + flow
        undone = cv2.remap(after, target[..., 0], target[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        length = float(np.sqrt((flow * flow).sum(axis=-1)).mean())
        match, unmatched = _compared(before, undone, where)
        right, down = np.median(flow[::SPARSE, ::SPARSE].reshape(-1, 2), axis=0)
        return Motion(match, length / before.shape[1], unmatched, (float(right), float(down)))


def local_correlation(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of the window around every pixel of two (H,W) pictures: the correlation -1..1, and the contrast in grey levels of
    the picture that has less of it there, and of the other."""
    a, b = first.astype(np.float32), second.astype(np.float32)
    size = (WINDOW_PX, WINDOW_PX)
    mean_a, mean_b = cv2.blur(a, size), cv2.blur(b, size)
    var_a = np.maximum(cv2.blur(a * a, size) - mean_a * mean_a, 0)
    var_b = np.maximum(cv2.blur(b * b, size) - mean_b * mean_b, 0)
    cov = cv2.blur(a * b, size) - mean_a * mean_b
    local = cov / (np.sqrt(var_a * var_b) + _NOISE)
    return local, np.sqrt(np.minimum(var_a, var_b)), np.sqrt(np.maximum(var_a, var_b))


def _compared(first: np.ndarray, second: np.ndarray, where: np.ndarray | None) -> tuple[float, float]:
    """Local zero-mean correlation of two (H,W) pictures, averaged with the local contrast as weight, -1..1; and the
    fraction of the picture that has texture and does not correlate. `where` (H,W) bool: the part that counts."""
    local, _, contrast = local_correlation(first, second)
    weight = contrast + 1
    unmatched = (local < _UNMATCHED) & (contrast > TEXTURE)
    if where is not None:
        weight, unmatched = weight * where, unmatched & where
    return float((weight * local).sum() / max(weight.sum(), 1e-6)), float(unmatched.mean())


@dataclass(frozen=True, eq=False)
class PlaceFeatures:
    """Features of one picture by which its place is recognised."""

    gray: np.ndarray
    """(H,W) uint8, the picture."""
    xy: np.ndarray
    """(N,2) float32, pixels."""
    features: np.ndarray
    """(N,128) float32."""


class PlaceRecogniser:
    """Whether two pictures of one size show the same place: features that agree on one similarity transform, and
    pictures that look alike once it is undone."""

    def __init__(self) -> None:
        self._sift = cv2.SIFT.create(nfeatures=300, contrastThreshold=0.02)
        self._matcher = cv2.BFMatcher()
        self._meter = MotionMeter()

    def features(self, gray: np.ndarray) -> PlaceFeatures:
        """The features of a (H,W) uint8 picture."""
        points, features = self._sift.detectAndCompute(gray, None)
        if not points:
            return PlaceFeatures(gray, np.zeros((0, 2), np.float32), np.zeros((0, 128), np.float32))
        return PlaceFeatures(gray, np.array([point.pt for point in points], np.float32), features)

    def similarity(
        self, first: PlaceFeatures, second: PlaceFeatures, left_out: np.ndarray | None = None
    ) -> np.ndarray | None:
        """(2,3): takes pixels of the first picture to those of the second; None if they do not show one place.

        `left_out` (H,W) bool: the part of both that says nothing.
        """
        left_out = np.zeros(first.gray.shape, bool) if left_out is None else left_out
        a, b = self._matches(first, second)
        filmed = ~(lies_in(left_out, a) & lies_in(left_out, b))
        a, b = a[filmed], b[filmed]
        if len(a) < _SAME_PLACE_INLIERS:
            return None
        cv2.setRNGSeed(0)
        found, inliers = cv2.estimateAffinePartial2D(a, b, ransacReprojThreshold=3.0, maxIters=500)
        if found is None or int(inliers.sum()) < _SAME_PLACE_INLIERS:
            return None
        return None if self._match(first, second, found, left_out) < _SAME_PLACE_MATCH else found

    def _matches(self, first: PlaceFeatures, second: PlaceFeatures) -> tuple[np.ndarray, np.ndarray]:
        """(M,2) pixels of features of the first picture, and of those of the second that look most like them."""
        if min(len(first.xy), len(second.xy)) < _SAME_PLACE_INLIERS:
            return np.zeros((0, 2), np.float32), np.zeros((0, 2), np.float32)
        pairs = np.array([
            (pair[0].queryIdx, pair[0].trainIdx)
            for pair in self._matcher.knnMatch(first.features, second.features, k=2)
            if len(pair) == 2 and pair[0].distance < 0.8 * pair[1].distance
        ], int).reshape(-1, 2)  # fmt: skip
        return first.xy[pairs[:, 0]], second.xy[pairs[:, 1]]

    def _match(
        self, first: PlaceFeatures, second: PlaceFeatures, similarity: np.ndarray, left_out: np.ndarray
    ) -> float:
        """-1..1: how alike two pictures are where they overlap, once a transform of one to the other is undone, and the
        motion that it leaves."""
        size, back = second.gray.shape[::-1], cv2.WARP_INVERSE_MAP | cv2.INTER_LINEAR
        moved = cv2.warpAffine(second.gray, similarity, size, flags=back)
        filmed = np.where(left_out, 0, 255).astype(np.uint8)
        shown = (cv2.warpAffine(filmed, similarity, size, flags=back) == 255) & ~left_out
        return self._meter(first.gray, np.where(shown, moved, first.gray), shown).match


def lies_in(part: np.ndarray, xy: np.ndarray) -> np.ndarray:
    """(N,) bool: which of (N,2) pixels (centres at whole numbers) lie in a part (H,W) of a picture."""
    column, row = np.clip(xy.round().astype(int), 0, np.array(part.shape[::-1]) - 1).T
    return np.asarray(part[row, column])


def mean_shift(similarity: np.ndarray, shape: tuple[int, ...]) -> float:
    """Mean shift of a (H,W) picture by a similarity transform (2,3), as a fraction of W."""
    height, width = shape
    corners = np.array([[x, y, 1] for x in (0, width / 2, width) for y in (0, height / 2, height)], np.float64)
    return float(np.linalg.norm(corners @ similarity.T - corners[:, :2], axis=1).mean() / width)


def color_histogram(hsv: np.ndarray) -> np.ndarray:
    """(256,) float32 histogram over the hue, saturation and value of a (H,W,3) uint8 picture, summing to 1."""
    counts = cv2.calcHist([hsv], [0, 1, 2], None, [8, 4, 8], [0, 180, 0, 256, 0, 256]).ravel()
    return np.asarray(counts / counts.sum(), np.float32)
