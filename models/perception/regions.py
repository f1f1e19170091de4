"""Square, rotated regions of a picture: what the networks look at, and the maps from their pixels to the picture's.

All coordinates have pixel centres at (0.5, 0.5); OpenCV's warp has them at integers, so half a pixel moves on each
side.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float

BODY_MARGIN = 1.25
"""Side of a person's region over the diameter of the circle about the hips that holds the body, as in training."""

HEIGHT_OF_SIDE = 1 / 1.6
"""A standing person's height over the side of his region."""


@dataclass(frozen=True)
class Region:
    """A square of `side` pixels about (x, y), its upward axis rotated clockwise by `angle` radians on the picture."""

    x: float
    y: float
    side: float
    angle: float = 0.0

    def to_source(self, size: int) -> Float[np.ndarray, "2 3"]:
        """Affine map from pixels of a crop of size × size to the picture's."""
        scale = self.side / size
        c, s = np.cos(self.angle) * scale, np.sin(self.angle) * scale
        linear = np.array([[c, -s], [s, c]])
        offset = np.array([self.x, self.y]) - linear @ np.array([size / 2, size / 2])
        return np.column_stack([linear, offset])

    def scaled(self, factor: float) -> "Region":
        """The region with its side multiplied by factor."""
        return Region(self.x, self.y, self.side * factor, self.angle)

    def moved(self, dx: float, dy: float) -> "Region":
        """The region shifted by (dx, dy) pixels."""
        return Region(self.x + dx, self.y + dy, self.side, self.angle)

    def outlier_of(self, other: "Region", *, shift: float, ratio: float) -> bool:
        """True where this region lies more than shift sides away from other, or differs in size by more than ratio."""
        distance = float(np.hypot(self.x - other.x, self.y - other.y))
        relative = self.side / other.side
        return distance > shift * other.side or not 1 / ratio < relative < ratio


def body_region(hip: np.ndarray, rim: np.ndarray) -> Region:
    """Region of a person from the hip centre and the point above the head on the circle that holds the body."""
    dx, dy = float(rim[0] - hip[0]), float(rim[1] - hip[1])
    return Region(float(hip[0]), float(hip[1]), 2 * float(np.hypot(dx, dy)) * BODY_MARGIN, float(np.arctan2(dx, -dy)))


def transform(affine: Float[np.ndarray, "2 3"], points: Float[np.ndarray, "... 2"]) -> Float[np.ndarray, "... 2"]:
    """Points through an affine map."""
    moved: np.ndarray = points @ affine[:, :2].T + affine[:, 2]
    return moved


def invert(affine: Float[np.ndarray, "2 3"]) -> Float[np.ndarray, "2 3"]:
    """The inverse affine map."""
    linear = np.linalg.inv(affine[:, :2])
    return np.column_stack([linear, -linear @ affine[:, 2]])


def warp(image: np.ndarray, target_to_source: Float[np.ndarray, "2 3"], size: tuple[int, int], *, border: int = 0,
         nearest: bool = False) -> np.ndarray:  # fmt: skip
    """Picture of size (width, height) whose pixel p shows the source at target_to_source(p); `border` outside."""
    matrix = target_to_source.copy()
    matrix[:, 2] += matrix[:, :2] @ np.array([0.5, 0.5]) - 0.5
    flags = (cv2.INTER_NEAREST if nearest else cv2.INTER_LINEAR) | cv2.WARP_INVERSE_MAP
    warped: np.ndarray = cv2.warpAffine(
        image, matrix, size, flags=flags, borderMode=cv2.BORDER_CONSTANT, borderValue=border
    )
    return warped
