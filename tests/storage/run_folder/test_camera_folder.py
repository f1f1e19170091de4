import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from humanmm.errors import InputError
from humanmm.models.records.camera import CrossCheck, Intrinsics, ShotCamera
from humanmm.models.records.shots import ShotList
from humanmm.models.records.video import VideoFacts
from humanmm.storage.run_folder.camera_folder import write_camera_folder

FACTS = VideoFacts(640, 360, np.arange(6) / 25, np.ones(6, bool), 0, "h264", "mp4")
INTRINSICS = Intrinsics(500.0, 640, 360, "estimated", 0.03)


def camera(start: int, end: int) -> ShotCamera:
    count = end - start
    K = np.tile([[500.0, 0, 320], [0, 500, 180], [0, 0, 1]], (count, 1, 1))
    t = np.arange(count)[:, None] * [0.1, 0, 0]
    return ShotCamera(
        start, end, np.tile(np.eye(3), (count, 1, 1)), t, K, "tracked", metric=False, reprojection_px=0.4,
        cross_check=CrossCheck(two_view_deg=0.2), warnings=("it is dark",),
    )  # fmt: skip


def write(folder: Path, *, force: bool = False) -> None:
    zooming = camera(4, 6)
    zooming = replace(zooming, K=zooming.K * np.array([1.0, 1.1])[:, None, None])
    write_camera_folder(folder, FACTS, ShotList(6, (), ()), INTRINSICS, (camera(0, 4), zooming), force=force)


def test_every_shot_has_a_trajectory_and_its_facts(tmp_path: Path) -> None:
    write(tmp_path / "cameras")
    rows = np.loadtxt(tmp_path / "cameras/shot_001.tum")
    np.testing.assert_allclose(rows, [[0.16, 0, 0, 0, 0, 0, 0, 1], [0.2, 0.1, 0, 0, 0, 0, 0, 1]])
    tree = json.loads((tmp_path / "cameras/cameras.json").read_text())
    assert tree["interlaced"] is False
    first, second = tree["shots"]
    assert (first["start"], first["end"], first["source"], first["metric"]) == (0, 4, "tracked", False)
    assert first["K"][0] == [500.0, 0.0, 320.0] and first["focal_px"] == 500.0
    assert second["focal_px"] == pytest.approx([500.0, 550.0])
    assert first["cross_check"] == {"two_view_deg": 0.2, "bundle_deg": None, "bundle_travel": None}
    assert first["warnings"] == ["it is dark"]


def test_what_is_there_is_replaced_by_force_alone_and_only_if_it_holds_cameras(tmp_path: Path) -> None:
    write(tmp_path / "cameras")
    with pytest.raises(InputError, match="--force"):
        write(tmp_path / "cameras")
    (tmp_path / "cameras/shot_007.tum").touch()
    write(tmp_path / "cameras", force=True)
    assert not (tmp_path / "cameras/shot_007.tum").exists()
    (tmp_path / "cameras/motion.bvh").touch()
    with pytest.raises(InputError, match="other things"):
        write(tmp_path / "cameras", force=True)
    assert [path.name for path in tmp_path.iterdir()] == ["cameras"]
