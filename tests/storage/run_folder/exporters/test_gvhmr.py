"""GVHMR's files, read by our own reader of its results and by torch."""

from pathlib import Path

import numpy as np
import torch
import two_people
from scipy.spatial.transform import Rotation

from humanmm.models.body.smpl_joints import SMPLX_REST_PELVIS, SmplJoints
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.storage.readers.systems import read_result
from humanmm.storage.run_folder.exporters import export

RECORDING = two_people.recording()


def test_the_reader_of_other_systems_finds_our_motion(tmp_path: Path) -> None:
    path = export(RECORDING, tmp_path, "gvhmr")[0]
    result = read_result(path, num_frames=40, fps=29.97).people[0]
    given = RECORDING.people[0]
    assert result.R_world_root is not None
    np.testing.assert_allclose(result.R_world_root, rotvec_to_rotmat(given.root_orient), atol=1e-4)
    np.testing.assert_allclose(np.diff(result.joints[:, 0], axis=0), np.diff(given.pelvis, axis=0), atol=1e-5)


def test_torch_loads_plain_tensors_of_the_shapes_that_gvhmrs_tools_expect(tmp_path: Path) -> None:
    path = export(RECORDING, tmp_path, "gvhmr")[1]
    tree = torch.load(path, weights_only=True)
    for space in ("smpl_params_global", "smpl_params_incam"):
        shapes = {name: tuple(value.shape) for name, value in tree[space].items()}
        assert shapes == {"body_pose": (30, 63), "betas": (30, 10), "global_orient": (30, 3), "transl": (30, 3)}
        assert all(value.dtype == torch.float32 for value in tree[space].values())
    assert tree["K_fullimg"].shape == (30, 3, 3)
    assert tree["frame"].tolist() == list(range(5, 35))
    assert (~tree["observed"]).sum() == 4


def test_the_person_in_the_camera_falls_on_the_pixels_of_the_person_in_the_world(tmp_path: Path) -> None:
    tree = torch.load(export(RECORDING, tmp_path, "gvhmr")[0], weights_only=True)
    incam = {name: value.double().numpy() for name, value in tree["smpl_params_incam"].items()}
    hips = np.zeros((24, 3))
    hips[0], hips[1] = SMPLX_REST_PELVIS, SMPLX_REST_PELVIS + np.array([0.1, -0.1, 0])
    pose = np.concatenate([incam["body_pose"], np.zeros((40, 6))], axis=1)
    skeleton = SmplJoints(hips, np.zeros((24, 3, 10)))
    joints = skeleton.posed(incam["global_orient"], pose, np.zeros(10), incam["transl"])
    pixels = joints @ np.swapaxes(tree["K_fullimg"].double().numpy(), -1, -2)
    given, R = RECORDING.people[0], Rotation.from_rotvec(RECORDING.people[0].root_orient)
    for joint, offset in ((0, (0, 0, 0)), (1, (0.1, -0.1, 0))):
        world = given.pelvis + R.apply(offset)
        cam = np.einsum("nji,nj->ni", RECORDING.R_world_cam, world - RECORDING.t_world_cam)
        expected = np.einsum("nij,nj->ni", RECORDING.K, cam)
        difference = pixels[:, joint, :2] / pixels[:, joint, 2:] - expected[:, :2] / expected[:, 2:]
        assert np.abs(difference).max() < 0.01
