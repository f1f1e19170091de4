"""GVHMR's result (`hmr4d_results.pt`): SMPL-X parameters in a world with y up and in each frame's camera, and K.

Its tools have one row for every frame of a video at 30 Hz and know one person. Rows are the person's own frames;
`frame` says which, `observed` where the motion was not filled in. `betas` are zero, because body24 has its own shape
basis; `betas_body24` holds body24's.
"""

from pathlib import Path

import numpy as np

from humanmm.models.body.smpl_joints import SMPLX_REST_PELVIS
from humanmm.models.geometry.projection import world_to_camera
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.motion.excerpt import Excerpt
from humanmm.models.records.recording import RecordedPerson
from humanmm.storage.run_folder.exporters.amass import BODY_JOINTS

_NUM_BETAS = 10


def write_gvhmr(excerpt: Excerpt, person: RecordedPerson, path: Path) -> None:
    """One person as a file of torch that holds plain tensors."""
    import torch

    recording, frame = excerpt.recording, person.frame
    R_world_root = rotvec_to_rotmat(person.root_orient)
    R_world_cam, t_world_cam = recording.R_world_cam[frame], recording.t_world_cam[frame]
    pelvis_cam = world_to_camera(person.pelvis[:, None], R_world_cam, t_world_cam)[:, 0]

    def parameters(R_root: np.ndarray, pelvis: np.ndarray) -> dict[str, torch.Tensor]:
        return {
            "body_pose": tensor(person.body_pose[:, :BODY_JOINTS].reshape(len(frame), -1)),
            "betas": torch.zeros(len(frame), _NUM_BETAS),
            "global_orient": tensor(rotmat_to_rotvec(R_root)),
            "transl": tensor(pelvis - SMPLX_REST_PELVIS),
        }

    def tensor(values: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(np.ascontiguousarray(values, np.float32))

    tree = {
        "smpl_params_global": parameters(excerpt.R_file_world @ R_world_root, excerpt.points(person.pelvis)),
        "smpl_params_incam": parameters(np.swapaxes(R_world_cam, -1, -2) @ R_world_root, pelvis_cam),
        "K_fullimg": tensor(recording.K[frame]),
        "betas_body24": tensor(person.betas),
        "frame": torch.from_numpy(excerpt.source_frame[frame].astype(np.int64)),
        "observed": torch.from_numpy(person.observed.copy()),
    }
    with path.open("wb") as file:  # a path would be written into the file
        torch.save(tree, file)
