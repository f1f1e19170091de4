"""COLMAP models, read again by pycolmap."""

from pathlib import Path

import numpy as np
import pycolmap
import two_people

from humanmm.models.motion.excerpt import Wishes
from humanmm.storage.run_folder.exporters import export

RECORDING = two_people.recording()


def test_pycolmap_projects_a_joint_to_its_pixel_in_every_frame(tmp_path: Path) -> None:
    paths = export(RECORDING, tmp_path, "colmap")
    model = pycolmap.Reconstruction(str(paths[0].parent))
    assert model.num_images() == 40 and model.num_cameras() == 1 + 15, "one for the shot that does not zoom"
    for image in model.images.values():
        frame = int(image.name.removeprefix("frame_").removesuffix(".png"))
        point = RECORDING.people[0].joints[frame, 15].astype(float)
        cam = (point - RECORDING.t_world_cam[frame]) @ RECORDING.R_world_cam[frame] @ RECORDING.K[frame].T
        np.testing.assert_allclose(image.project_point(point), cam[:2] / cam[2], atol=0.01)


def test_images_of_a_span_keep_the_numbers_of_the_video(tmp_path: Path) -> None:
    wishes = Wishes(start_s=float(RECORDING.time_s[30]))
    text = export(RECORDING, tmp_path, "colmap", wishes=wishes)[1].read_text()
    assert text.splitlines()[1].endswith(" frame_000030.png")
