"""What `hmr` makes of rendered windows: the errors that ms-HMR, trajectory predictor and refiner have to live with."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.body.body24 import load_body
from humanmm.models.body.proportions import bone_lengths, in_detector_convention, shape_from_bones
from humanmm.models.geometry.projection import inverse_pose
from humanmm.models.learning.pairs import WindowArrays
from humanmm.models.motion.fit.evidence import gather
from humanmm.models.motion.fit.hmr import fit_person
from humanmm.models.motion.fit.state import CameraPath
from humanmm.models.perception.interfaces import Lifter
from humanmm.models.perception.lifting.lifted import lifted_people
from humanmm.models.perception.observation import MIN_CONFIDENCE
from humanmm.models.perception.regions import Region
from humanmm.models.records.tracks import MASK_SIDE, PersonTrack, ScenePeople, Silhouettes

Array = np.ndarray

FEWEST_FRAMES = 8
"""A window in which a person is seen less often is not fitted."""


@dataclass(frozen=True, eq=False)
class FittedWindow(WindowArrays):
    """One window of `learning.pairs.PairWindow`, n frames; zeros where nothing was fitted."""

    observed: Bool[Array, " n"]
    fitted: Bool[Array, " n"]
    """From the first observed frame to the last."""
    R_cam_root_fitted: Float[Array, "n 3 3"]
    body_pose_fitted: Float[Array, "n 23 3"]
    pelvis_cam_fitted: Float[Array, "n 3"]
    confidence_fitted: Float[Array, " n"]
    betas_fitted: Float[Array, " 10"]


def fit_window(window: Mapping[str, Array], lifter: Lifter) -> FittedWindow:
    """The body fitted to what the networks saw in one window of pairs (its arrays), with its true camera."""
    arrays = {name: values.astype(np.float64) for name, values in window.items()}
    n = len(arrays["time_s"])
    empty = FittedWindow(
        np.zeros(n, bool), np.zeros(n, bool), np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 23, 3)), np.zeros((n, 3)),
        np.zeros(n), np.zeros(10),
    )  # fmt: skip
    seen = np.flatnonzero(arrays["confidence"] >= MIN_CONFIDENCE)
    if len(seen) < FEWEST_FRAMES:
        return empty
    size = (int(arrays["size"][0]), int(arrays["size"][1]))
    people = ScenePeople(0, n, (_track(arrays, seen),))
    track = lifted_people(people, lifter, arrays["time_s"], size).tracks[0]
    bones = in_detector_convention(bone_lengths(track.landmarks3d.astype(np.float64)), lifted=track.is_in_space)
    betas = shape_from_bones(bones, load_body()).astype(np.float64)
    evidence = gather(track, (0, n), arrays["time_s"], arrays["K"])
    if evidence is None:
        return empty
    R_first, t_first = arrays["R_world_cam"][0], arrays["t_world_cam"][0]
    R, t = R_first.T @ arrays["R_world_cam"], (arrays["t_world_cam"] - t_first) @ R_first
    rows = slice(int(evidence.frame[0]), int(evidence.frame[-1]) + 1)
    fit = fit_person(0, evidence, betas, CameraPath(*inverse_pose(R[rows], t[rows]), arrays["K"][rows]))
    empty.observed[fit.frame], empty.fitted[fit.frame] = fit.observed, True
    empty.R_cam_root_fitted[fit.frame], empty.body_pose_fitted[fit.frame] = fit.R_cam_root, fit.body_pose
    empty.pelvis_cam_fitted[fit.frame], empty.confidence_fitted[fit.frame] = fit.pelvis_cam, fit.confidence
    empty.betas_fitted[:] = fit.betas
    return empty


def _track(window: Mapping[str, Array], seen: Array) -> PersonTrack:
    """What the networks saw, as a tracker would hand it on."""
    n = len(seen)
    affine = np.stack([Region(*row).to_source(MASK_SIDE) for row in window["region"][seen].tolist()])
    return PersonTrack(
        frame=seen.astype(np.int32),
        keypoints2d=window["keypoints"][seen].astype(np.float32),
        landmarks3d=window["landmarks3d"][seen].astype(np.float32),
        bbox=np.zeros((n, 4), np.float32),
        confidence=window["confidence"][seen].astype(np.float32),
        masks=Silhouettes(np.zeros(0, np.uint8), np.zeros(n, np.int64)),
        mask_affine=affine,
        color_frame=np.zeros(0, np.int32),
        color_histogram=np.zeros((0, 1), np.float32),
        keypoint_sigma=window["keypoint_sigma"][seen].astype(np.float32),
    )
