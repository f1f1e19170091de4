"""Point tracks, intrinsics and camera trajectories, as they travel between stages."""

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float

SOURCES = ("static", "tracked", "rotation_only", "given", "fallback")
"""Index = code in motion.zarr's cameras/source."""

CameraSource = Literal["static", "tracked", "rotation_only", "given", "fallback"]

FocalSource = Literal["given", "metadata", "estimated", "default"]

CameraModel = Literal["static", "rotation only", "rotation and zoom", "moving"]


@dataclass(frozen=True)
class PointTracks:
    """Tracked image points of one scene or shot [start, end), as a flat list of M observations sorted by frame.

    Frames in which the picture stood still since the last recorded one carry no observations; the first and the last
    do.
    """

    start: int
    end: int
    track: np.ndarray
    """(M,) int32, number of the point."""
    frame: np.ndarray
    """(M,) int32, index into the video."""
    xy: np.ndarray
    """(M,2) float32, source pixels, centres at .5."""
    confidence: np.ndarray
    """(M,) float32, 0..1 (from the forward-backward error)."""
    window_px: float
    """Side of the tracker's window in source pixels: what a point feels of its surroundings."""
    rate_hz: float = 30.0
    """Mean frame rate of the video; a tracker need not know it (`models.camera.points`)."""


@dataclass(frozen=True)
class GivenCameras:
    """Cameras of M of the video's frames that the user gives, in one world of their own."""

    frame: np.ndarray
    """(M,) int32, strictly increasing index into the video."""
    R_given_cam: np.ndarray
    """(M,3,3) float64, camera (x right, y down, z forward) to that world."""
    t_given_cam: np.ndarray
    """(M,3) float64, camera centres there, in any unit."""
    focal_px: np.ndarray
    """(M,) float64, pixels of the video; nan where not given."""
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class ChosenModel:
    """The camera model of one shot [start, end)."""

    start: int
    end: int
    model: CameraModel


@dataclass(frozen=True, eq=False)
class EdgeEvidence:
    """What the straight edges of one frame say of its focal length."""

    frame: int
    log_focal: np.ndarray
    """(n,) float64, increasing: ln(focal in pixels)."""
    values: np.ndarray
    """(n,) float64, their log likelihood; 0 is the likeliest."""

    def log_likelihood(self, log_focal: np.ndarray) -> np.ndarray:
        """(m,) at other focal lengths; beyond the ends as there."""
        return np.asarray(np.interp(log_focal, self.log_focal, self.values))

    def enlarged(self, factor: float) -> "EdgeEvidence":
        """The same of a lens that is `factor` times as long."""
        return replace(self, log_focal=self.log_focal + math.log(factor))


DOUBTFUL_FOCAL = 0.2
"""Relative uncertainty of an estimated focal length above which it gets a warning."""


def is_doubtful_focal(source: str, relative_uncertainty: float) -> bool:
    """Whether a focal length from such a source (`Intrinsics.source`) gets a warning: an assumed one does."""
    return source == "default" or (source == "estimated" and relative_uncertainty > DOUBTFUL_FOCAL)


@dataclass(frozen=True)
class OwnLens:
    """The focal length of one shot [start, end) that does not have the video's."""

    start: int
    end: int
    focal_px: float
    source: FocalSource
    relative_uncertainty: float
    distortion: float = 0.0
    """See `Intrinsics`."""


@dataclass(frozen=True)
class Intrinsics:
    """One camera for all shots but those with a lens of their own, its principal point in the middle
    (`geometry.intrinsics.K_of`)."""

    focal_px: float
    width: int
    height: int
    source: FocalSource
    relative_uncertainty: float
    """Standard deviation of the focal length, as a fraction of it."""
    warnings: tuple[str, ...] = ()
    cameras: GivenCameras | None = None
    """Cameras that the user gives; none unless he does."""
    models: tuple[ChosenModel, ...] = ()
    """Of the shots whose model was settled in estimating the focal length."""
    edges: tuple[EdgeEvidence, ...] = ()
    """Of a key frame of some shots: one that zooms has a focal length of its own there."""
    lenses: tuple[OwnLens, ...] = ()
    """Of the shots that have a lens of their own."""
    distortion: float = 0.0
    """How the lens bends straight lines (`geometry.intrinsics.straightened`); 0 of a pinhole camera, which a lens is
    taken for unless its points clearly say otherwise. `focal_px` is that of the middle of the picture."""

    def of_shot(self, start: int, end: int) -> "Intrinsics":
        """Those of the shot [start, end)."""
        own = next((one for one in self.lenses if (one.start, one.end) == (start, end)), None)
        if own is None:
            return self
        return replace(
            self, focal_px=own.focal_px, source=own.source, relative_uncertainty=own.relative_uncertainty,
            distortion=own.distortion, lenses=(),
        )  # fmt: skip

    def model_of(self, start: int, end: int) -> CameraModel | None:
        """The model of the shot [start, end) if it is settled."""
        return next((one.model for one in self.models if (one.start, one.end) == (start, end)), None)


@dataclass(frozen=True)
class CrossCheck:
    """How far pycolmap's own answers lie from ours, key frames against key frames; nan where it has none."""

    two_view_deg: float = float("nan")
    """Relative rotations of distant key frames, median."""
    bundle_deg: float = float("nan")
    """Rotations after its bundle adjustment, largest."""
    bundle_travel: float = float("nan")
    """Camera centres after its bundle adjustment and the best similarity, largest, as a fraction of their extent."""


@dataclass(frozen=True, eq=False)
class Scenery:
    """Points of the background that a camera which travels has placed in space."""

    positions: np.ndarray
    """(p,3) float32, shot frame, in the unit of the camera's path."""
    relative_std: np.ndarray
    """(p,) float32, standard deviation of their distance from the camera, as a fraction of it."""


@dataclass(frozen=True)
class ShotCamera:
    """Camera of one shot [start, end) in the frame of its own first camera ("shot" frame: x right, y down, z
    forward)."""

    start: int
    end: int
    R_shot_cam: np.ndarray
    """(F,3,3) float64, camera to shot; the first is the identity."""
    t_shot_cam: np.ndarray
    """(F,3) float64, camera centre in the shot frame; metres if `metric`, else up to one scale; zero if static or
    rotation only."""
    K: np.ndarray
    """(F,3,3) float64: the shared intrinsics in every frame; of a camera that zooms, its own focal lengths where the
    points determine them, else such that the shared one is the middle of their range."""
    source: CameraSource
    metric: bool
    reprojection_px: float
    """Median reprojection error of the background points, pixels; of given cameras how far the points lie beside where
    these have them from one key frame to the next. nan if there are none."""
    cross_check: CrossCheck = CrossCheck()
    warnings: tuple[str, ...] = ()
    scenery: Scenery | None = None
    """What a camera that was tracked as it travels has seen; None of all others."""

    @property
    def travels(self) -> bool:
        """Its centre moves."""
        return bool(np.any(self.t_shot_cam))

    @property
    def zooms(self) -> bool:
        """Its focal length changes."""
        return bool((self.K[1:] != self.K[:-1]).any())

    @property
    def stays(self) -> bool:
        """Its picture shows the same of the background all the time."""
        return not (self.travels or self.zooms or (self.R_shot_cam[1:] != self.R_shot_cam[:-1]).any())


def through_lens(
    xy: Float[np.ndarray, "n *k 2"], K_seen: Float[np.ndarray, "n 3 3"], K: Float[np.ndarray, "3 3"]
) -> Float[np.ndarray, "n *k 2"]:
    """Pixels that were seen with `K_seen`, one lens a row, where a camera with the lens `K` sees the same directions.

    Principal points are in the middle and pixels square, as everywhere here.
    """
    ratio = (K[0, 0] / K_seen[:, 0, 0]).reshape(-1, *([1] * (xy.ndim - 1)))
    return np.asarray(K[:2, 2] + ratio * (xy - K[:2, 2]))
