"""Stage `intrinsics`: of all who say what the focal length is, the one who knows best is believed."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from filmed_points import FOCAL, HEIGHT, WIDTH, make_scene
from held_results import inputs_of

from humanmm.models.camera.background.keyframes import KeyFrameFeatures
from humanmm.models.records.camera import Intrinsics
from humanmm.models.records.shots import Scenes, Shot, ShotList
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.tasks.intrinsics import intrinsics

N = 40


def _found(corrections: tuple[dict[str, Any], ...] = (), **settings: Any) -> Intrinsics:
    """For a shot of a camera that pans, whose points determine its focal length."""
    results = {
        "decode": VideoFacts(WIDTH, HEIGHT, np.arange(N) / 30, np.arange(N) == 0, 0, "h264", "mp4"),
        "scenes": Scenes(N, ()),
        "shots": ShotList(N, (Shot(0, 0, N, 0, None, ()),), ()),
        "people": [ScenePeople(0, N, ())],
        "points": [make_scene("pan", num_frames=N, num_points=200).points],
        "keyframes": KeyFrameFeatures(((),)),
    }
    return intrinsics(inputs_of("intrinsics", results, intrinsics=settings, corrections=list(corrections)))


def test_a_correction_counts_before_the_setting_and_the_setting_before_the_pictures() -> None:
    correction = ({"kind": "focal", "px": 700.0},)
    assert _found(correction, focal_px=500.0).focal_px == 700.0
    assert _found(focal_px=500.0).focal_px == 500.0
    assert _found(fov_deg=90.0).focal_px == pytest.approx(WIDTH / 2)
    seen = _found()
    assert seen.source == "estimated" and seen.focal_px == pytest.approx(FOCAL, rel=0.05)


def test_cameras_that_the_user_brings_along_are_passed_on(tmp_path: Path) -> None:
    rows = [f"{k / 30:.6f} {0.1 * k:.6f} 0 0 0 0 0 1" for k in range(N)]
    (tmp_path / "cameras.txt").write_text("\n".join(rows))
    found = _found(focal_px=500.0, cameras_from=str(tmp_path / "cameras.txt"))
    assert found.cameras is not None and _found(focal_px=500.0).cameras is None
    np.testing.assert_allclose(found.cameras.t_given_cam[:, 0], 0.1 * np.arange(N), atol=1e-6)
