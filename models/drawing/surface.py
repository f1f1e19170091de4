"""The surface that is drawn: body24 with 2,000 triangles, with fingers 3,200, posed frame by frame in camera axes.

`weights/body24_drawn.npz` and `body52_drawn.npz` name the kept vertices (scripts/build_drawn_mesh makes them: the body
without tongue and eyeballs, decimated). Normals come from the full mesh at rest and rotate with the skinning, so that
the small mesh is shaded like the big one.
"""

import io
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int

from humanmm.models.body.body24 import Body
from humanmm.models.body.fingers import body_of
from humanmm.models.body.kinematics import forward_kinematics, skinning_transforms
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.records.recording import RecordedPerson
from humanmm.models.weights.shipped import read_weights

_WINDOW = 128
"""Frames whose joint transforms are computed at a time (0.15 MB)."""


@dataclass(frozen=True, eq=False)
class DrawnMesh:
    """Which of body24's vertices are drawn, and the triangles between them."""

    vertices: Int[np.ndarray, " v"]
    """Indices into body24's vertices."""
    faces: Int[np.ndarray, "f 3"]
    """Indices into `vertices`, counter-clockwise seen from outside."""


@lru_cache(maxsize=2)
def load_drawn_mesh(name: str = "body24_drawn.npz") -> DrawnMesh:
    """One of the shipped small meshes."""
    with np.load(io.BytesIO(read_weights(name))) as file:
        return DrawnMesh(file["vertices"].astype(np.int64), file["faces"].astype(np.int64))


class PosedSurface:
    """One recorded person's drawn surface over time."""

    def __init__(self, person: RecordedPerson) -> None:
        body = body_of(person)
        mesh = load_drawn_mesh("body24_drawn.npz" if person.hand_pose is None else "body52_drawn.npz")
        rest = body.rest_vertices(person.betas)
        self.faces = mesh.faces
        self._person = person
        self._parents = body.parents
        self._rest_joints = body.rest_joints(person.betas)
        self._rest = rest[mesh.vertices].astype(np.float32)
        self._normals = vertex_normals(body, rest)[mesh.vertices]
        self._weights = dense_weights(body, mesh.vertices)
        self._window = (0, np.zeros((0, len(body.parents), 12), np.float32))

    def in_camera(
        self, row: int, R_world_cam: Float[np.ndarray, "3 3"], t_world_cam: Float[np.ndarray, "3"]
    ) -> tuple[Float[np.ndarray, "v 3"], Float[np.ndarray, "v 3"]]:
        """Vertices (metres) and unit normals of one row of the person, in camera axes, float32."""
        transforms = (self._weights @ self._transforms(row)).reshape(-1, 3, 4)
        R = R_world_cam.astype(np.float32)
        world = np.einsum("vab,vb->va", transforms[..., :3], self._rest) + transforms[..., 3]
        normals = np.einsum("vab,vb->va", transforms[..., :3], self._normals) @ R
        normals /= np.linalg.norm(normals, axis=1, keepdims=True) + 1e-9
        return (world - t_world_cam.astype(np.float32)) @ R, normals

    def _transforms(self, row: int) -> np.ndarray:
        start, window = self._window
        if not start <= row < start + len(window):
            start = row - row % _WINDOW
            window = self._compute(slice(start, start + _WINDOW))
            self._window = (start, window)
        transforms: np.ndarray = window[row - start]
        return transforms

    def _compute(self, rows: slice) -> np.ndarray:
        person = self._person
        joints, R = forward_kinematics(
            self._rest_joints,
            rotvec_to_rotmat(person.root_orient[rows].astype(np.float64)),
            person.pose(rows).astype(np.float64),
            person.pelvis[rows].astype(np.float64),
            self._parents,
        )
        transforms = skinning_transforms(self._rest_joints, joints, R)
        return transforms.astype(np.float32).reshape(*transforms.shape[:2], 12)


def dense_weights(body: Body, vertices: np.ndarray) -> np.ndarray:
    """(n,J) float32 skinning weight of each joint for the chosen vertices."""
    weights = np.zeros((len(vertices), len(body.parents)), np.float32)
    np.add.at(weights, (np.arange(len(vertices))[:, None], body.skin_joint[vertices]), body.skin_weight[vertices])
    return weights


def vertex_normals(body: Body, vertices: np.ndarray) -> np.ndarray:
    """(V,3) float32 unit normals of the whole mesh with these vertices."""
    corners = vertices[body.faces]
    face_normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(normals, body.faces[:, corner], face_normals)
    return np.asarray(normals / (np.linalg.norm(normals, axis=1, keepdims=True) + 1e-12), np.float32)
