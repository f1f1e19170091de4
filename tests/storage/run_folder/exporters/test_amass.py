"""SMPL-X parameters as the Blender add-on and GMR read them."""

from pathlib import Path

import numpy as np
import pytest
import two_people
from hand_points import with_hands

from humanmm.models.body.fingers import from_flat_hands
from humanmm.models.body.smpl_joints import SMPLX_REST_PELVIS
from humanmm.models.motion.excerpt import Wishes
from humanmm.storage.run_folder.exporters import export
from humanmm.storage.run_folder.exporters.amass import reader_rate

RECORDING = two_people.recording(fps=30.0)
N = 40
AMASS = {
    "betas": ((16,), "float64"), "trans": ((N, 3), "float64"), "poses": ((N, 165), "float64"),
    "root_orient": ((N, 3), "float64"), "pose_body": ((N, 63), "float64"), "pose_jaw": ((N, 3), "float64"),
    "pose_eye": ((N, 6), "float64"), "pose_hand": ((N, 90), "float64"), "betas_body24": ((10,), "float64"),
    "frame": ((N,), "int64"), "time_s": ((N,), "float64"), "observed": ((N,), "bool"),
}  # fmt: skip


def test_amass_has_the_keys_shapes_and_types_that_readers_expect(tmp_path: Path) -> None:
    path = export(RECORDING, tmp_path, "amass")[0]
    with np.load(path, allow_pickle=False) as file:
        arrays = dict(file)
    assert {key: (a.shape, str(a.dtype)) for key, a in arrays.items() if a.ndim} == AMASS
    assert str(arrays["gender"]) == "neutral"
    assert str(arrays["surface_model_type"]) == "smplx"
    assert arrays["mocap_frame_rate"].item() == 30.0
    assert arrays["num_betas"].item() == 16
    assert not arrays["betas"].any()


def test_amass_readers_place_the_pelvis_where_ours_is(tmp_path: Path) -> None:
    with np.load(export(RECORDING, tmp_path, "amass")[1]) as file:
        np.testing.assert_allclose(file["trans"] + SMPLX_REST_PELVIS, RECORDING.people[1].joints[:, 0], atol=1e-6)
        np.testing.assert_array_equal(file["poses"][:, :3], file["root_orient"])
        np.testing.assert_array_equal(file["poses"][:, 3:66], file["pose_body"])
        assert file["start_frame"].item() == 5
        np.testing.assert_array_equal(file["frame"], RECORDING.people[1].frame)
        np.testing.assert_array_equal(file["observed"], RECORDING.people[1].observed)


def test_an_amass_file_written_in_windows_holds_the_bytes_of_one_written_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    at_once = export(RECORDING, tmp_path / "once", "amass")
    monkeypatch.setattr("humanmm.storage.run_folder.exporters.amass._WINDOW", 5)
    in_windows = export(RECORDING, tmp_path / "windows", "amass")
    assert [path.read_bytes() for path in in_windows] == [path.read_bytes() for path in at_once]


@pytest.mark.parametrize(
    ("fps", "expected"),
    [(23.976, 30), (24, 30), (25, 30), (29.97, 30), (30, 30), (30.02, 30), (48, 60), (50, 60), (59.94, 60), (120, 120)],
)
def test_the_add_on_accepts_every_rate_and_keeps_time(tmp_path: Path, fps: float, expected: int) -> None:
    recording = two_people.recording(fps=fps)
    assert reader_rate(recording) == expected
    with np.load(export(recording, tmp_path, "amass")[0]) as file:
        rate, target = int(file["mocap_frame_rate"]), 30  # what the add-on does with its defaults
        assert rate >= target
        step = int(rate / target)
        shown = np.arange(0, len(file["trans"]), step)
        at_s = recording.time_s[0] + np.arange(len(shown)) / target
        given = recording.people[0].pelvis
        expected_xyz = np.stack([np.interp(at_s, recording.time_s, given[:, axis]) for axis in range(3)], 1)
        np.testing.assert_allclose(file["trans"][shown] + SMPLX_REST_PELVIS, expected_xyz, atol=1e-5)


def test_rows_of_ntsc_video_show_one_frame_after_another(tmp_path: Path) -> None:
    recording = two_people.recording(fps=30000 / 1001)
    with np.load(export(recording, tmp_path, "amass")[0]) as file:
        assert file["mocap_frame_rate"].item() == 30.0
        np.testing.assert_array_equal(file["frame"], np.arange(40))


def test_the_user_may_ask_for_the_rate_of_the_video(tmp_path: Path) -> None:
    recording = two_people.recording(fps=25.0)
    with np.load(export(recording, tmp_path, "amass", wishes=Wishes(fps=25.0))[0]) as file:
        assert file["mocap_frame_rate"].item() == 25.0
        np.testing.assert_array_equal(file["pose_body"], recording.people[0].body_pose[:, :21].reshape(40, -1))


def test_hands_are_those_of_a_body_whose_hands_are_flat_at_rest(tmp_path: Path) -> None:
    recording = with_hands(RECORDING)
    pose = recording.people[0].hand_pose
    assert pose is not None
    with np.load(export(recording, tmp_path, "amass")[0]) as file:
        np.testing.assert_allclose(file["pose_hand"], from_flat_hands(pose).reshape(N, 90), atol=1e-6)
        np.testing.assert_array_equal(file["poses"][:, 75:], file["pose_hand"])
