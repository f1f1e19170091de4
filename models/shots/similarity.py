"""How alike two small gray pictures are: as neighbours in time, and as views of one place.

Both measures ignore gain and offset, so that a flash or an exposure step is no change of scene.
"""

from dataclasses import dataclass

import cv2
import numpy as np

_WINDOW_PX = 9
"""Side of the window in which pictures are correlated."""
_NOISE = 16.0
"""Grey levels squared; variance that coding noise leaves in a flat window, so that flat windows count as alike."""
_SAME_PLACE_INLIERS = 10
"""Matches that agree on one similarity transform. Unrelated pictures reach 7, the same place 12 and more (measured)."""


@dataclass(frozen=True)
class Motion:
    """How one picture moves into the next."""

    match: float
    """-1..1, mean local correlation once the motion is undone: about 0.8 for neighbours, below 0.2 across a cut."""
    flow: float
    """Mean displacement as a fraction of the picture's width."""


class MotionMeter:
    """Motion between pictures of one size, by dense inverse search at its fastest setting (about 0.5 ms at 192 px)."""

    def __init__(self) -> None:
        self._dense = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST)
        self._grid = np.zeros((0, 0, 2), np.float32)

    def __call__(self, before: np.ndarray, after: np.ndarray) -> Motion:
        """Motion from one (H,W) uint8 picture to the next."""
        if before.shape[0] < 16 or before.shape[1] < 16:
            return Motion(correlation(before, after), 0.0)
        flow = np.zeros((*before.shape, 2), np.float32)
        self._dense.calc(before, after, flow)
        if self._grid.shape[:2] != before.shape:
            rows, columns = np.indices(before.shape, dtype=np.float32)
            self._grid = np.stack([columns, rows], axis=-1)
        target = self._grid + flow
        undone = cv2.remap(after, target[..., 0], target[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        length = float(np.sqrt((flow * flow).sum(axis=-1)).mean())
        return Motion(correlation(before, undone), length / before.shape[1])


def correlation(first: np.ndarray, second: np.ndarray) -> float:
    """Local zero-mean correlation of two (H,W) pictures, averaged with the local contrast as weight; -1..1."""
    a, b = first.astype(np.float32), second.astype(np.float32)
    size = (_WINDOW_PX, _WINDOW_PX)
    mean_a, mean_b = cv2.blur(a, size), cv2.blur(b, size)
    var_a = np.maximum(cv2.blur(a * a, size) - mean_a * mean_a, 0)
    var_b = np.maximum(cv2.blur(b * b, size) - mean_b * mean_b, 0)
    cov = cv2.blur(a * b, size) - mean_a * mean_b
    weight = np.sqrt(np.maximum(var_a, var_b)) + 1
    return float((weight * cov / (np.sqrt(var_a * var_b) + _NOISE)).sum() / weight.sum())


@dataclass(frozen=True)
class Landmarks:
    """Features of one picture by which its place is recognised."""

    xy: np.ndarray
    """(N,2) float32, pixels."""
    features: np.ndarray
    """(N,128) float32."""


class PlaceRecogniser:
    """Whether two pictures show the same place, from features that agree on one similarity transform."""

    def __init__(self) -> None:
        self._sift = cv2.SIFT.create(nfeatures=300, contrastThreshold=0.02)
        self._matcher = cv2.BFMatcher()

    def landmarks(self, gray: np.ndarray) -> Landmarks:
        """The features of a (H,W) uint8 picture."""
        points, features = self._sift.detectAndCompute(gray, None)
        if not points:
            return Landmarks(np.zeros((0, 2), np.float32), np.zeros((0, 128), np.float32))
        return Landmarks(np.array([point.pt for point in points], np.float32), features)

    def displacement(self, first: Landmarks, second: Landmarks, shape: tuple[int, int]) -> float | None:
        """Mean shift of a (H,W) picture between two views of one place, as a fraction of W; None if not one place."""
        if min(len(first.xy), len(second.xy)) < _SAME_PLACE_INLIERS:
            return None
        pairs = [
            (pair[0].queryIdx, pair[0].trainIdx)
            for pair in self._matcher.knnMatch(first.features, second.features, k=2)
            if len(pair) == 2 and pair[0].distance < 0.8 * pair[1].distance
        ]
        if len(pairs) < _SAME_PLACE_INLIERS:
            return None
        a, b = np.array(pairs).T
        cv2.setRNGSeed(0)
        similarity, inliers = cv2.estimateAffinePartial2D(
            first.xy[a], second.xy[b], ransacReprojThreshold=3.0, maxIters=500
        )
        if similarity is None or int(inliers.sum()) < _SAME_PLACE_INLIERS:
            return None
        height, width = shape
        corners = np.array([[x, y, 1] for x in (0, width / 2, width) for y in (0, height / 2, height)], np.float64)
        return float(np.linalg.norm(corners @ similarity.T - corners[:, :2], axis=1).mean() / width)


def color_histogram(hsv: np.ndarray) -> np.ndarray:
    """(256,) float32 histogram over the hue, saturation and value of a (H,W,3) uint8 picture, summing to 1."""
    counts = cv2.calcHist([hsv], [0, 1, 2], None, [8, 4, 8], [0, 180, 0, 256, 0, 256]).ravel()
    return np.asarray(counts / counts.sum(), np.float32)
