"""Pictures of a floor on which somebody's skin casts a shadow, drawn point by point: nothing of `models.shadows` draws
them."""

import math

import cv2
import numpy as np

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import forward_kinematics, skinning_transforms
from humanmm.models.camera.background.ground import HIDDEN, GroundPicture
from humanmm.models.geometry.intrinsics import K_of
from humanmm.models.motion.rotations.shot_results import ShotResults

LIT, DARKER = 150, 0.6
SCALE = 2.0
"""Source pixels of a pixel of the pictures."""


def shadowed(
    results: ShotResults,
    cameras: list[tuple[np.ndarray, np.ndarray]],
    *,
    azimuth_deg: float,
    elevation_deg: float = 45.0,
    darker: float = DARKER,
) -> list[tuple[GroundPicture, ...]]:
    """Of each shot, three whole frames of its first person under a light that comes from there in the world.

    `cameras`: R_world_cam and centre of each; the floor, a soft pattern, is z = 0.
    """
    angles = math.radians(azimuth_deg), math.radians(elevation_deg)
    towards = np.array([math.cos(angles[0]), math.sin(angles[0]), math.tan(angles[1])])
    K = np.diag([1 / SCALE, 1 / SCALE, 1.0]) @ K_of(results.intrinsics)
    size = (round(results.intrinsics.width / SCALE), round(results.intrinsics.height / SCALE))
    found = []
    for motion, (R, centre) in zip(results.motions, cameras, strict=True):
        assert motion is not None
        person = motion.people[0]
        pictures = []
        for row in (2, 9, 17):
            body = load_body()
            pelvis = person.pelvis_cam[row] @ R.T + centre
            rest, R_root = body.rest_joints(person.betas), R[None] @ person.R_cam_root[row]
            joints, rotations = forward_kinematics(rest, R_root, person.body_pose[[row]], pelvis[None])
            moved = skinning_transforms(rest, joints, rotations)[0][body.skin_joint]
            blended = np.einsum("vk,vkab->vab", body.skin_weight, moved)
            points = np.einsum("vab,vb->va", blended[..., :3], body.rest_vertices(person.betas)) + blended[..., 3]
            random = np.random.default_rng(row)
            pattern = cv2.GaussianBlur(random.normal(0, 30, size[::-1]), (0, 0), 4).astype(np.float32)
            picture = np.clip(LIT + pattern, 1, 255)
            on_floor = points - points[:, 2:] / towards[2] * towards
            picture[_dots(on_floor, R, centre, K, size)] *= darker
            gray = np.maximum(picture, HIDDEN + 1).astype(np.uint8)
            gray[_dots(points, R, centre, K, size)] = HIDDEN
            pictures.append(GroundPicture(int(person.frame[row]), np.zeros(2, np.float32), SCALE, gray))
        found.append(tuple(pictures))
    return found


def _dots(points: np.ndarray, R: np.ndarray, centre: np.ndarray, K: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    image = ((points - centre) @ R) @ K.T
    pixels = np.floor(image[:, :2] / image[:, 2:]).astype(int)
    mask = np.zeros(size[::-1], np.uint8)
    inside = ((pixels >= 0) & (pixels < size)).all(axis=1)
    mask[pixels[inside, 1], pixels[inside, 0]] = 1
    return cv2.morphologyEx(cv2.dilate(mask, np.ones((3, 3))), cv2.MORPH_CLOSE, np.ones((5, 5))) > 0
