"""The drawn body: made by its script, closed, and moved like the body it was made of."""

import hashlib
import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from humanmm.models.body.body24 import load_body
from humanmm.models.drawing.surface import PosedSurface, dense_weights, load_drawn_mesh, vertex_normals
from humanmm.models.records.recording import Recording
from humanmm.models.weights.shipped import manifest

SCRIPT = Path(__file__).parents[3] / "scripts" / "build_drawn_mesh"


@pytest.mark.slow
def test_the_script_makes_the_shipped_meshes_to_the_byte(tmp_path: Path) -> None:
    subprocess.run([sys.executable, str(SCRIPT), str(tmp_path)], check=True)
    for name in ("body24_drawn.npz", "body52_drawn.npz"):
        assert hashlib.sha256((tmp_path / name).read_bytes()).hexdigest() == manifest()[name].sha256


@pytest.mark.parametrize(("name", "num_faces"), [("body24_drawn.npz", 2000), ("body52_drawn.npz", 3200)])
def test_the_mesh_is_closed_and_its_triangles_agree_on_the_outside(name: str, num_faces: int) -> None:
    """Every directed edge stands once, and once the other way round."""
    faces = load_drawn_mesh(name).faces
    assert len(faces) == num_faces
    edges = Counter(map(tuple, np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).tolist()))
    assert set(edges.values()) == {1}
    assert all((b, a) in edges for a, b in edges)


def test_skinning_weights_add_up_to_one() -> None:
    body = load_body()
    np.testing.assert_allclose(dense_weights(body, np.arange(0, len(body.v_template), 97)).sum(axis=1), 1, atol=1e-5)


def test_normals_point_away_from_the_axis_of_the_trunk() -> None:
    body = load_body()
    normals = vertex_normals(body, body.v_template)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-5)
    chest = (np.abs(body.v_template[:, 1] - 0.2) < 0.05) & (np.abs(body.v_template[:, 0]) < 0.1)
    front = chest & (body.v_template[:, 2] > 0.08)
    assert (normals[front, 2] > 0).mean() > 0.95


def test_a_surface_in_t_pose_is_the_rest_shape_moved_to_the_pelvis(standing: Recording) -> None:
    """Camera axes of the fixture: x right, y down, z into the scene; the body looks at the camera."""
    body, person = load_body(), standing.people[0]
    vertices, normals = PosedSurface(person).in_camera(5, standing.R_world_cam[5], standing.t_world_cam[5])
    rest = body.rest_vertices(person.betas)[load_drawn_mesh().vertices] + person.transl[5] * [1, 0, 0]
    expected = np.stack([rest[:, 0], -rest[:, 1], -rest[:, 2]], axis=1)
    expected[:, 1] += standing.t_world_cam[5, 2] - person.transl[5, 2]
    expected[:, 2] += person.transl[5, 1] - standing.t_world_cam[5, 1]
    np.testing.assert_allclose(vertices, expected, atol=1e-4)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-5)
