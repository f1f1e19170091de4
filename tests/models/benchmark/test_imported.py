"""Other systems' parameters in our world: the same upright person from every system's conventions."""

import numpy as np
import pytest

from humanmm.errors import InputError
from humanmm.models.benchmark.imported import (
    SMPL_REST_PELVIS,
    SystemResult,
    gvhmr_result,
    imported_sequence,
    slahmr_result,
    tram_result,
    wham_result,
)
from humanmm.models.body.body24 import load_body

N = 5
PATH = np.stack([np.linspace(0, 1, N), np.full(N, 0.9), np.zeros(N)], axis=1)
"""Pelvis of somebody who walks along x in a world with y up."""


def _yup() -> dict[str, np.ndarray]:
    return {"global_orient": np.zeros((N, 3)), "body_pose": np.zeros((N, 63)), "transl": PATH - SMPL_REST_PELVIS}


def _joints(result: SystemResult) -> np.ndarray:
    return imported_sequence(result, num_frames=N, fps=30.0).people[0].joints


def test_a_person_upright_in_y_up_stands_upright_in_z_up_with_the_pelvis_where_it_was() -> None:
    joints = _joints(gvhmr_result(_yup()))
    np.testing.assert_allclose(joints[:, 0], np.stack([PATH[:, 0], -PATH[:, 2], PATH[:, 1]], axis=1), atol=1e-9)
    rest = load_body().J_template
    np.testing.assert_allclose(np.ptp(joints[0, :, 2]), np.ptp(rest[:, 1]), atol=1e-6)


def test_wham_and_slahmr_give_the_same_person_as_gvhmr() -> None:
    ours = _joints(gvhmr_result(_yup()))
    track = {"pose_world": np.zeros((N, 72)), "trans_world": _yup()["transl"], "frame_ids": np.arange(N)}
    short = {**track, "frame_ids": np.arange(2)}
    found = wham_result([short, track])
    np.testing.assert_allclose(_joints(found), ours, atol=1e-9)
    assert found.notes == ("2 tracks were found; one is compared.",)
    yup = _yup()
    arrays = {
        "root_orient": yup["global_orient"][None], "pose_body": yup["body_pose"][None], "trans": yup["transl"][None],
        "floor_plane": np.array([[0.0, -2.0, 0.0, 0.0]]),
    }  # fmt: skip
    upside_down = _joints(slahmr_result(arrays))  # its floor's normal, taken upwards in the camera's axes, is −y
    np.testing.assert_allclose(upside_down[..., 2], -ours[..., 2], atol=1e-9)


def test_trams_person_moves_with_its_camera() -> None:
    """The camera moves along x by a metre while the person stays in front of it."""
    arrays = {
        "pred_rotmat": np.tile(np.eye(3), (N, 24, 1, 1)), "pred_trans": np.zeros((N, 3)), "frame": np.arange(N),
        "pred_cam_R": np.tile(np.eye(3), (N, 1, 1)), "pred_cam_T": PATH * [1, 0, 0],
    }  # fmt: skip
    pelvis = _joints(tram_result(arrays))[:, 0]
    np.testing.assert_allclose(pelvis[-1] - pelvis[0], [1, 0, 0], atol=1e-9)


@pytest.mark.parametrize(("change", "sentence"), [
    ({"body_pose": np.zeros((N, 60))}, "body_pose has shape 5×60; expected 5×63"),
    ({"transl": None}, "transl is missing"),
])  # fmt: skip
def test_wrong_parameters_are_named(change: dict[str, np.ndarray | None], sentence: str) -> None:
    parameters = {name: value for name, value in {**_yup(), **change}.items() if value is not None}
    with pytest.raises(InputError, match=sentence):
        gvhmr_result(parameters)
