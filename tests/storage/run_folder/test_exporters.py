"""Files for other people's tools: what they read is what we hold."""

import csv
from pathlib import Path

import numpy as np
import pytest

from humanmm.cli.results import FORMATS as OFFERED
from humanmm.errors import InputError
from humanmm.models.body.body24 import JOINT_NAMES
from humanmm.models.records.recording import Recording
from humanmm.storage.run_folder.exporters import FORMATS, export
from humanmm.storage.run_folder.exporters.amass import SMPLX_REST_PELVIS

N = 12
AMASS = {
    "betas": ((16,), "float64"), "trans": ((N, 3), "float64"), "poses": ((N, 165), "float64"),
    "root_orient": ((N, 3), "float64"), "pose_body": ((N, 63), "float64"), "pose_jaw": ((N, 3), "float64"),
    "pose_eye": ((N, 6), "float64"), "pose_hand": ((N, 90), "float64"), "betas_body24": ((10,), "float64"),
}  # fmt: skip


def test_amass_has_the_keys_shapes_and_types_that_readers_expect(tmp_path: Path, recording: Recording) -> None:
    path = export(recording, tmp_path, "amass")[0]
    with np.load(path, allow_pickle=False) as file:
        arrays = dict(file)
    assert {key: (a.shape, str(a.dtype)) for key, a in arrays.items() if a.ndim} == AMASS
    assert str(arrays["gender"]) == "neutral"
    assert str(arrays["surface_model_type"]) == "smplx"
    assert arrays["mocap_frame_rate"].item() == pytest.approx(recording.fps)
    assert arrays["num_betas"].item() == 16
    assert not arrays["betas"].any()


def test_amass_readers_place_the_pelvis_where_ours_is(tmp_path: Path, recording: Recording) -> None:
    with np.load(export(recording, tmp_path, "amass")[1]) as file:
        np.testing.assert_allclose(file["trans"] + SMPLX_REST_PELVIS, recording.people[1].joints[:, 0], atol=1e-6)
        np.testing.assert_array_equal(file["poses"][:, :3], file["root_orient"])
        np.testing.assert_array_equal(file["poses"][:, 3:66], file["pose_body"])


def test_an_amass_file_written_in_windows_holds_the_bytes_of_one_written_at_once(
    tmp_path: Path, recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    at_once = export(recording, tmp_path / "once", "amass")
    monkeypatch.setattr("humanmm.storage.run_folder.exporters.amass._WINDOW", 5)
    in_windows = export(recording, tmp_path / "windows", "amass")
    assert [path.read_bytes() for path in in_windows] == [path.read_bytes() for path in at_once]


def test_csv_holds_every_joint_of_every_frame(tmp_path: Path, recording: Recording) -> None:
    with export(recording, tmp_path, "csv")[1].open(newline="") as file:
        rows = list(csv.DictReader(file))
    person = recording.people[1]
    xyz = np.array([[float(row[axis]) for axis in ("x_m", "y_m", "z_m")] for row in rows]).reshape(-1, 24, 3)
    np.testing.assert_allclose(xyz, person.joints, atol=1e-5)
    assert [int(row["frame"]) for row in rows[::24]] == person.frame.tolist()


def test_trc_is_y_up_with_the_markers_of_the_joints(tmp_path: Path, recording: Recording) -> None:
    lines = export(recording, tmp_path, "trc")[0].read_text().splitlines()
    assert lines[0].split("\t")[3] == "person_00.trc"
    assert lines[2].split("\t")[2:5] == ["12", "24", "m"]
    assert lines[3].split("\t")[2::3][:24] == list(JOINT_NAMES)
    body = np.array([[float(value) for value in line.split("\t")] for line in lines[6:]])
    assert body.shape == (12, 2 + 72)
    xyz = body[:, 2:].reshape(12, 24, 3)
    expected = recording.people[0].joints
    np.testing.assert_allclose(np.stack([xyz[..., 0], -xyz[..., 2], xyz[..., 1]], -1), expected, atol=1e-5)


def test_asking_for_the_amass_files_that_a_run_folder_holds_already_is_fine_unless_they_were_changed(
    tmp_path: Path, recording: Recording
) -> None:
    first = export(recording, tmp_path, "amass")
    assert export(recording, tmp_path, "amass") == first
    first[1].write_bytes(b"somebody's own work")
    with pytest.raises(InputError, match="--force"):
        export(recording, tmp_path, "amass")


def test_the_command_line_offers_the_formats_that_exist() -> None:
    assert tuple(FORMATS) == OFFERED


@pytest.mark.parametrize("name", [name for name in FORMATS if name != "amass"])
def test_an_export_is_not_overwritten_unasked(tmp_path: Path, name: str, recording: Recording) -> None:
    export(recording, tmp_path, name)
    with pytest.raises(InputError, match="--force"):
        export(recording, tmp_path, name)
    assert len(export(recording, tmp_path, name, force=True)) == 2


def test_an_unknown_format_names_those_that_exist(tmp_path: Path, recording: Recording) -> None:
    with pytest.raises(InputError, match="amass"):
        export(recording, tmp_path, "fbx")
