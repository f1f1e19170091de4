"""C3D files, read again by ezc3d."""

import os
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


def test_ezc3d_reads_the_joints_and_the_frames_without_the_person(tmp_path: Path) -> None:
    ezc3d = pytest.importorskip("ezc3d", reason="pip install 'humanmm[c3d]'")
    file = ezc3d.c3d(str(export(RECORDING, tmp_path, "c3d")[1]))
    person = RECORDING.people[1]
    points, residuals = file["data"]["points"], file["data"]["meta_points"]["residuals"]
    assert points.shape == (4, 24, 40)
    np.testing.assert_allclose(points[:3, :, 5:35].T / 1000, person.joints, atol=1e-6)
    assert np.isnan(points[:3, :, :5]).all() and np.isnan(points[:3, :, 35:]).all()
    assert (residuals[0, :, :5] == -1).all() and (residuals[0, :, 35:] == -1).all()
    np.testing.assert_array_equal(residuals[0, 0, 5:35] > 0, person.observed)
    about = file["parameters"]["POINT"]
    assert about["LABELS"]["value"] == list(JOINT_NAMES) and about["UNITS"]["value"] == ["mm"]
    assert about["RATE"]["value"][0] == pytest.approx(29.97)
    events = file["parameters"]["EVENT"]
    assert events["LABELS"]["value"] == ["cut"]
    assert np.ravel(events["TIMES"]["value"])[1] == pytest.approx(two_people.CUT / 29.97)


def test_a_folder_may_have_a_name_that_is_not_utf_8(tmp_path: Path) -> None:
    pytest.importorskip("ezc3d", reason="pip install 'humanmm[c3d]'")
    for path in export(RECORDING, tmp_path / os.fsdecode(b"\xff"), "c3d"):
        assert path.stat().st_size > 0


def test_axes_and_unit_are_as_requested(tmp_path: Path) -> None:
    ezc3d = pytest.importorskip("ezc3d", reason="pip install 'humanmm[c3d]'")
    file = ezc3d.c3d(str(export(RECORDING, tmp_path, "c3d", wishes=Wishes(up="y", unit="m"))[0]))
    x, y, z = np.moveaxis(RECORDING.people[0].joints, -1, 0)
    np.testing.assert_allclose(file["data"]["points"][:3].T, np.stack([x, z, -y], -1), atol=1e-6)
    assert file["parameters"]["POINT"]["Y_SCREEN"]["value"] == ["+Y"]


def test_more_frames_than_the_format_counts_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("ezc3d", reason="pip install 'humanmm[c3d]'")
    monkeypatch.setattr("humanmm.storage.run_folder.exporters.c3d.MAX_FRAMES", 39)
    with pytest.raises(InputError, match="counts to 39 frames, these are 40; take a part"):
        export(RECORDING, tmp_path, "c3d")


def test_without_ezc3d_a_sentence_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ezc3d", None)
    with pytest.raises(InputError, match=r"pip install 'humanmm\[c3d\]'"):
        export(RECORDING, tmp_path, "c3d")
    assert not list(tmp_path.iterdir())
