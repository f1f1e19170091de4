"""USD scenes, read again by Pixar's library."""

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest
import two_people

from humanmm.errors import InputError
from humanmm.models.body.body24 import JOINT_NAMES
from humanmm.models.motion.excerpt import Wishes
from humanmm.storage.run_folder.exporters import export

RECORDING = two_people.recording()


@pytest.mark.parametrize("wishes", [Wishes(), Wishes(up="y", unit="cm")])
def test_usd_skel_finds_the_joints_of_the_run(tmp_path: Path, wishes: Wishes) -> None:
    pxr = pytest.importorskip("pxr", reason="pip install 'humanmm[usd]'")
    from pxr import Usd, UsdGeom, UsdSkel

    assert pxr
    stage = Usd.Stage.Open(str(export(RECORDING, tmp_path, "usd", wishes=wishes)[0]))
    assert UsdGeom.GetStageUpAxis(stage) == (wishes.up or "z").upper()
    assert UsdGeom.GetStageMetersPerUnit(stage) == pytest.approx(0.01 if wishes.unit == "cm" else 1)
    scale = 100 if wishes.unit == "cm" else 1
    cache = UsdSkel.Cache()
    for person in RECORDING.people:
        place = f"/humanmm/person_{person.person:02d}"
        root = UsdSkel.Root.Get(stage, place)
        cache.Populate(root, Usd.PrimDefaultPredicate)
        query = cache.GetSkelQuery(UsdSkel.Skeleton.Get(stage, f"{place}/skeleton"))
        assert [str(name).split("/")[-1] for name in query.GetJointOrder()] == list(JOINT_NAMES)
        for row in (0, 13, len(person.frame) - 1):
            code = float(person.frame[row])
            matrices = query.ComputeJointSkelTransforms(code)
            found = np.array([matrix.ExtractTranslation() for matrix in matrices]) / scale
            x, y, z = person.joints[row].T
            expected = np.stack([x, z, -y] if wishes.up == "y" else [x, y, z], axis=1)
            assert np.abs(found - expected).max() < 1e-4
            assert UsdGeom.Imageable(root).ComputeVisibility(code) == "inherited"
    hidden = UsdGeom.Imageable(UsdSkel.Root.Get(stage, "/humanmm/person_01"))
    assert [hidden.ComputeVisibility(code) for code in (0.0, 4.0, 35.0, 39.0)] == ["invisible"] * 4


def test_who_is_not_seen_for_long_is_invisible(tmp_path: Path) -> None:
    pytest.importorskip("pxr", reason="pip install 'humanmm[usd]'")
    from pxr import Usd, UsdGeom, UsdSkel

    recording = two_people.recording(num_frames=60, fps=10.0)
    seen = np.ones(60, bool)
    seen[20:50] = False
    recording = dataclasses.replace(
        recording, people=(dataclasses.replace(recording.people[0], observed=seen),), worlds=(0, 3)
    )
    for keep, expected in ((False, "invisible"), (True, "inherited")):
        wishes = Wishes(keep_unseen=keep)
        stage = Usd.Stage.Open(str(export(recording, tmp_path / expected, "usd", wishes=wishes)[0]))
        root = UsdSkel.Root.Get(stage, "/humanmm/person_00")
        found = [UsdGeom.Imageable(root).ComputeVisibility(code) for code in (0.0, 19.0, 20.0, 49.0, 50.0)]
        assert found == ["inherited", "inherited", expected, expected, "inherited"]
        assert root.GetPrim().GetAttribute("humanmm:world").Get() == 0
        camera = stage.GetPrimAtPath("/humanmm/camera_shot_001")
        assert camera.GetAttribute("humanmm:world").Get() == 3


def test_the_camera_sees_a_joint_at_its_pixel_zoom_included(tmp_path: Path) -> None:
    pytest.importorskip("pxr", reason="pip install 'humanmm[usd]'")
    from pxr import Gf, Usd, UsdGeom

    stage = Usd.Stage.Open(str(export(RECORDING, tmp_path, "usd")[0]))
    for shot, frame in ((0, 3), (0, 24), (1, 25), (1, 38)):
        camera = UsdGeom.Camera.Get(stage, f"/humanmm/camera_shot_{shot:03d}").GetCamera(frame)
        view = camera.frustum.ComputeViewMatrix() * camera.frustum.ComputeProjectionMatrix()
        point = RECORDING.people[0].joints[frame, 15].astype(float)
        x, y, _ = view.Transform(Gf.Vec3d(*point.tolist()))
        cam = (point - RECORDING.t_world_cam[frame]) @ RECORDING.R_world_cam[frame] @ RECORDING.K[frame].T
        np.testing.assert_allclose([640 * (1 + x), 360 * (1 - y)], cam[:2] / cam[2], atol=0.05)


def test_without_usd_core_a_sentence_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(InputError, match=r"pip install 'humanmm\[usd\]'"):
        export(RECORDING, tmp_path, "usd")
    assert not list(tmp_path.iterdir())
