"""A mesh with fewer triangles on some of the old vertices: quadric edge collapse (Garland and Heckbert 1997).

Collapsing an edge onto one of its ends, never to a new point, lets the small mesh keep the big one's shape directions
and skinning weights. It made `weights/body24_drawn.npz` once; nothing calls it at run time.
"""

import heapq

import numpy as np
from jaxtyping import Float, Int

SMALLEST_TURN_COSINE = 0.2
"""A collapse may not turn a triangle's normal further than this (78°): that would fold the surface."""


def decimate(
    vertices: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    num_faces: int,
    *,
    attributes: Float[np.ndarray, "V A"],
    attribute_weight: float,
) -> tuple[Int[np.ndarray, " v"], Int[np.ndarray, "f 3"]]:
    """Indices of the kept vertices, and the triangles between them (indices into the kept ones).

    The mesh must be closed and two-manifold. A difference of `attributes` (skinning weights) across an edge costs like
    a displacement of attribute_weight × difference.
    """
    collapse = _Collapse(vertices.astype(np.float64), faces.astype(np.int64), attributes, attribute_weight)
    while collapse.num_faces > num_faces and collapse.step():
        pass
    return collapse.result()


class _Collapse:
    def __init__(self, vertices: np.ndarray, faces: np.ndarray, attributes: np.ndarray, weight: float) -> None:
        self.vertices = vertices
        self.attributes = attributes * weight
        self.faces = {index: list(map(int, face)) for index, face in enumerate(faces)}
        self.faces_of: list[set[int]] = [set() for _ in vertices]
        for index, face in self.faces.items():
            for vertex in face:
                self.faces_of[vertex].add(index)
        self.quadrics = _vertex_quadrics(vertices, faces)
        self.area = np.zeros(len(vertices))
        corners = vertices[faces]
        doubled = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        np.add.at(self.area, faces, doubled[:, None] / 6)
        self.stamp = np.zeros(len(vertices), np.int64)
        self.heap: list[tuple[float, int, int, int, int]] = []
        for a, b in {tuple(sorted((int(f[i]), int(f[i - 1])))) for f in faces for i in range(3)}:
            self._push(a, b)

    @property
    def num_faces(self) -> int:
        return len(self.faces)

    def step(self) -> bool:
        """Do the cheapest collapse that is still valid; false when none is left."""
        while self.heap:
            _, gone, kept, stamp_gone, stamp_kept = heapq.heappop(self.heap)
            if self.stamp[gone] == stamp_gone and self.stamp[kept] == stamp_kept and self._is_valid(gone, kept):
                self._collapse(gone, kept)
                return True
        return False

    def result(self) -> tuple[np.ndarray, np.ndarray]:
        faces = np.array([self.faces[index] for index in sorted(self.faces)])
        kept, compact = np.unique(faces, return_inverse=True)
        return kept, compact.reshape(faces.shape)

    def _push(self, a: int, b: int) -> None:
        """Put both directions of an edge into the queue."""
        quadric = self.quadrics[a] + self.quadrics[b]
        difference = float(((self.attributes[a] - self.attributes[b]) ** 2).sum())
        for gone, kept in ((a, b), (b, a)):
            point = np.append(self.vertices[kept], 1.0)
            cost = float(point @ quadric @ point) + difference * self.area[gone]
            heapq.heappush(self.heap, (cost, gone, kept, int(self.stamp[gone]), int(self.stamp[kept])))

    def _neighbours(self, vertex: int) -> set[int]:
        return {other for face in self.faces_of[vertex] for other in self.faces[face]} - {vertex}

    def _is_valid(self, gone: int, kept: int) -> bool:
        shared = self.faces_of[gone] & self.faces_of[kept]
        if len(shared) != 2 or len(self._neighbours(gone) & self._neighbours(kept)) != 2:
            return False
        for index in self.faces_of[gone] - shared:
            before = self.vertices[self.faces[index]]
            after = self.vertices[[kept if v == gone else v for v in self.faces[index]]]
            normal, turned = _normal(before), _normal(after)
            lengths = np.linalg.norm(normal) * np.linalg.norm(turned)
            if lengths < 1e-16 or normal @ turned < SMALLEST_TURN_COSINE * lengths:
                return False
        return True

    def _collapse(self, gone: int, kept: int) -> None:
        for index in self.faces_of[gone] & self.faces_of[kept]:
            for vertex in self.faces.pop(index):
                self.faces_of[vertex].discard(index)
        for index in self.faces_of[gone]:
            self.faces[index] = [kept if v == gone else v for v in self.faces[index]]
            self.faces_of[kept].add(index)
        self.faces_of[gone] = set()
        self.quadrics[kept] += self.quadrics[gone]
        self.area[kept] += self.area[gone]
        self.stamp[gone] += 1
        self.stamp[kept] += 1
        for neighbour in self._neighbours(kept):
            self._push(kept, neighbour)


def _normal(corners: np.ndarray) -> np.ndarray:
    a, b = corners[1] - corners[0], corners[2] - corners[0]
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _vertex_quadrics(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(V,4,4) sum of area/3 · p pᵀ over a vertex's triangles with planes p: xᵀQx is squared distance × area."""
    corners = vertices[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    doubled_area = np.linalg.norm(normal, axis=1)
    normal /= np.maximum(doubled_area, 1e-18)[:, None]
    plane = np.concatenate([normal, -np.einsum("fi,fi->f", normal, corners[:, 0])[:, None]], axis=1)
    quadric = np.einsum("fi,fj->fij", plane, plane) * (doubled_area / 6)[:, None, None]
    result = np.zeros((len(vertices), 4, 4))
    for corner in range(3):
        np.add.at(result, faces[:, corner], quadric)
    return result
