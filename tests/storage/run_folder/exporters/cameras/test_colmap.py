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


def test_pycolmap_reads_the_background_in_the_world_of_the_images(tmp_path: Path) -> None:
    points = np.random.default_rng(1).uniform(-3, 3, (50, 3))
    paths = export(RECORDING, tmp_path, "colmap", scenery=lambda: {0: points[:20], 1: points[20:]})
    model = pycolmap.Reconstruction(str(paths[0].parent))
    found = np.array([model.points3D[number].xyz for number in sorted(model.points3D)])
    np.testing.assert_allclose(found, points, atol=1e-5)
    one = model.points3D[1]
    assert one.color.tolist() == [128, 128, 128] and one.error == -1 and one.track.length() == 0


def test_points_have_the_axes_and_the_unit_of_the_images(tmp_path: Path) -> None:
    point = RECORDING.people[0].joints[7, 15].astype(float)
    wishes = Wishes(up="y", unit="cm")
    paths = export(RECORDING, tmp_path, "colmap", wishes=wishes, scenery=lambda: {0: point[None]})
    model = pycolmap.Reconstruction(str(paths[0].parent))
    (image,) = (image for image in model.images.values() if image.name == "frame_000007.png")
    cam = (point - RECORDING.t_world_cam[7]) @ RECORDING.R_world_cam[7] @ RECORDING.K[7].T
    np.testing.assert_allclose(image.project_point(model.points3D[1].xyz), cam[:2] / cam[2], atol=0.01)


def test_a_span_has_the_background_of_its_shots_alone(tmp_path: Path) -> None:
    wishes = Wishes(start_s=float(RECORDING.time_s[30]))
    scenery = {0: np.zeros((4, 3)), 1: np.ones((2, 3))}
    paths = export(RECORDING, tmp_path, "colmap", wishes=wishes, scenery=lambda: scenery)
    model = pycolmap.Reconstruction(str(paths[0].parent))
    assert [point.xyz.tolist() for point in model.points3D.values()] == [[1.0, 1.0, 1.0]] * 2
