"""The pose network's output beside the truth, a person in a shot at a time, measured as `detector_noise.detect` makes
them: in the picture as a fraction of the height that the landmarks span, in 3D about the mid-hip in its ray's axes.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.body.landmarks import load_landmarks
from humanmm.models.geometry.alignment import kabsch
from humanmm.models.geometry.projection import project, ray_axes, world_to_camera
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.records.sequence import CameraSequence, MotionSequence, PersonSequence
from humanmm.models.synthetic.detector_errors import PersonErrors
from humanmm.models.synthetic.detector_noise import BODY, LIMBS, NEAR_M, DetectorNoise, detect, speeds
from humanmm.models.synthetic.mocap import leg_length

Array = np.ndarray

HIDDEN_BELOW = 0.5
"""Mean visibility of a limb's landmarks below which it counts as hidden."""
OUTLIER = 0.12
"""Mean error of a visible limb, fraction of the height, from which it counts as lost."""


@dataclass(frozen=True, eq=False)
class Series:
    """One person in one shot beside the truth, n frames."""

    errors: PersonErrors
    fps: float
    points: Float[Array, "n 33 3"]
    """True landmarks in camera axes, metres."""
    K: Float[Array, "n 3 3"]
    behind: Bool[Array, " n"]
    stature: float
    """Length of the legs over the average's."""
    picture: Float[Array, "n 33 2"]
    """Detected minus true position, fractions of the height."""
    rotation: Float[Array, "n 3"]
    """Rotation of the 3D landmarks, radians."""
    solid: Float[Array, "n 33 3"]
    """What is left of the 3D error after rotation and scale, metres."""
    scale: float
    speed: Float[Array, "n parts"]
    """True speed of the body's parts about its middle, heights a second."""

    @property
    def found(self) -> Bool[Array, " n"]:
        return self.errors.found

    @cached_property
    def hidden(self) -> Bool[Array, "limbs n"]:
        """Which limbs the network itself says it cannot see."""
        visibility = self.errors.keypoints[..., 2]
        return np.stack([visibility[:, list(limb)].mean(axis=1) < HIDDEN_BELOW for limb in LIMBS])

    @cached_property
    def lost(self) -> Bool[Array, "limbs n"]:
        distance = np.linalg.norm(self.picture, axis=-1)
        far = np.stack([distance[:, list(limb)].mean(axis=1) > OUTLIER for limb in LIMBS])
        return np.asarray(far & ~self.hidden)

    @cached_property
    def usable(self) -> Bool[Array, "n 33"]:
        """Landmarks below the neck that are seen, hidden and lost limbs aside."""
        usable = ~limb_mask(self.hidden | self.lost)
        usable[:, :11] = False
        usable[~self.found] = False
        return usable

    def steps(self, rest_speed: float) -> Float[Array, "n parts"]:
        """Path length of the body's parts from the frame before."""
        return np.asarray((self.speed + rest_speed) / self.fps)

    def body_steps(self, rest_speed: float) -> Float[Array, " n"]:
        """Mean path length of all parts below the neck."""
        return np.asarray(self.steps(rest_speed)[:, 1:].mean(axis=1))


def series_of(sequence: MotionSequence, errors: PersonErrors) -> Series:
    """The output about one person in one shot beside the truth, which must have cameras and body parameters."""
    person, cameras = sequence.people[errors.person], sequence.cameras
    assert cameras is not None
    points, behind, stature = true_landmarks(person, cameras, errors.rows)
    return _residuals(errors, sequence.fps, points, cameras.K[person.frame[errors.rows]], behind, stature)


def _residuals(
    errors: PersonErrors,
    fps: float,
    points: Float[Array, "n 33 3"],
    K: Float[Array, "n 3 3"],
    behind: Bool[Array, " n"],
    stature: float,
) -> Series:
    pixels = project(points, K, near_m=NEAR_M)
    height = np.ptp(pixels[..., 1], axis=1)[:, None, None]
    ray = points[:, 23:25].mean(axis=1)
    R_cam_ray = ray_axes(ray)
    true = np.einsum("nba,nkb->nka", R_cam_ray, points - ray[:, None])
    seen = errors.landmarks - errors.landmarks[:, 23:25].mean(axis=1, keepdims=True)
    R = np.tile(np.eye(3), (len(points), 1, 1))
    found = errors.found
    R[found] = kabsch(true[found][:, BODY], seen[found][:, BODY], np.ones((int(found.sum()), 22)))
    rotated = np.einsum("nab,nkb->nka", R, true)
    sizes = np.linalg.norm(seen[found][:, BODY], axis=(1, 2)) / np.linalg.norm(rotated[found][:, BODY], axis=(1, 2))
    scale = float(np.median(sizes)) if found.any() else 1.0
    return Series(
        errors, fps, points, K, behind, stature,
        picture=(errors.keypoints[..., :2] - pixels) / height,
        rotation=rotmat_to_rotvec(R),
        solid=seen - scale * rotated,
        scale=scale,
        speed=speeds(pixels, fps),
    )  # fmt: skip


def true_landmarks(
    person: PersonSequence, cameras: CameraSequence, rows: Int[Array, " n"]
) -> tuple[Float[Array, "n 33 3"], Bool[Array, " n"], float]:
    """Landmarks in camera axes, metres, whether the camera sees the back, and the stature."""
    betas, joints, R_world_joint = posed_truth(person, rows)
    points = load_landmarks().place(betas, joints, R_world_joint)
    R_world_cam, t_world_cam = cameras.R_world_cam[person.frame[rows]], cameras.t_world_cam[person.frame[rows]]
    in_camera = world_to_camera(points, R_world_cam, t_world_cam)
    behind = (R_world_joint[:, 0, :, 2] * (t_world_cam - joints[:, 0])).sum(axis=1) < 0
    body = load_body()
    return in_camera, behind, leg_length(body.rest_joints(betas)) / leg_length(body.J_template)


def posed_truth(
    person: PersonSequence, rows: Int[Array, " n"]
) -> tuple[Float[Array, "10"], Float[Array, "n 24 3"], Float[Array, "n 24 3 3"]]:
    """Betas of somebody of a truth, his joints (world, metres) and their rotations to the world, by his body's pose.

    ValueError if the truth has no body model.
    """
    if person.body is None:
        raise ValueError("the truth has no body model; give clips that dataset build ms-render made")
    betas, R_root = person.body.betas, rotvec_to_rotmat(person.body.root_orient[rows])
    rest = load_body().rest_joints(betas)
    return betas, *forward_kinematics(rest, R_root, person.body.body_pose[rows], person.joints[rows, 0])


def limb_mask(limbs: Bool[Array, "limbs n"]) -> Bool[Array, "n 33"]:
    """(N,33) true for the landmarks of the limbs that are marked in each of N frames."""
    mask = np.zeros((limbs.shape[1], 33), bool)
    for limb, rows in zip(LIMBS, limbs, strict=True):
        mask[np.ix_(rows, list(limb))] = True
    return mask


def simulate(one: Series, noise: DetectorNoise, rng: np.random.Generator, size: tuple[int, int]) -> Series:
    """The same person in the same shot with modelled errors instead of measured ones; sides as the truth has them."""
    still = replace(noise, swap_rate=(0.0, 0.0), miss_rate=0.0)
    made = detect(
        one.points, one.K, size, one.behind, one.stature, one.fps, still, rng,
        pitch=one.errors.pitch, roll=one.errors.roll,
    )  # fmt: skip
    errors = replace(
        one.errors, keypoints=made.keypoints.astype(float), landmarks=made.landmarks.astype(float), found=made.found
    )
    return _residuals(errors, one.fps, one.points, one.K, one.behind, one.stature)
