"""motion.zarr: the public contract, array by array."""

import dataclasses
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
import zarr
from hand_points import with_hands

from humanmm.errors import InputError
from humanmm.models.records.recording import Delivery, Recording
from humanmm.storage.run_folder.motion_zarr import read_motion, write_motion, write_run_folder
from humanmm.storage.store.files import replace_folder, sweep

F, N, K = 12, 12, 33
CONTRACT = {
    "time_s": ((F,), "float64"), "shot_index": ((F,), "int32"), "cameras/R_world_cam": ((F, 3, 3), "float32"),
    "cameras/t_world_cam": ((F, 3), "float32"), "cameras/K": ((F, 3, 3), "float32"), "cameras/source": ((F,), "uint8"),
    "people/00/frame": ((N,), "int32"), "people/00/observed": ((N,), "bool"),
    "people/00/root_orient": ((N, 3), "float32"), "people/00/body_pose": ((N, 23, 3), "float32"),
    "people/00/betas": ((10,), "float32"), "people/00/transl": ((N, 3), "float32"),
    "people/00/joints": ((N, 24, 3), "float32"), "people/00/contacts": ((N, 4), "float32"),
    "people/00/keypoints2d": ((N, K, 3), "float32"), "people/00/bbox": ((N, 4), "float32"),
    "people/00/confidence": ((N,), "float32"),
}  # fmt: skip


def test_every_array_of_the_contract_is_there_with_its_shape_dtype_and_checksum(
    tmp_path: Path, recording: Recording
) -> None:
    write_motion(tmp_path / "motion.zarr", recording)
    group = zarr.open_group(tmp_path / "motion.zarr", mode="r")
    found = {key: array for key, array in group.members(max_depth=None) if isinstance(array, zarr.Array)}
    first = {key: (array.shape, str(array.dtype)) for key, array in found.items() if not key.startswith("people/01")}
    assert first == CONTRACT
    assert {key for key in found if key.startswith("people/01")} == {
        key.replace("/00/", "/01/") for key in CONTRACT if key.startswith("people/00")
    }
    for key, array in found.items():
        assert any(type(codec).__name__ == "Crc32cCodec" for codec in array.metadata.codecs), key


def test_every_attribute_of_the_contract_is_there(tmp_path: Path, recording: Recording) -> None:
    write_motion(tmp_path / "motion.zarr", recording)
    attributes = dict(zarr.open_group(tmp_path / "motion.zarr", mode="r").attrs)
    assert attributes["schema"] == "humanmm.motion/1"
    assert attributes["fps"] == pytest.approx(11 / (recording.time_s[-1] - recording.time_s[0]))
    assert (attributes["width"], attributes["height"], attributes["num_frames"]) == (640, 360, 12)
    assert attributes["world"] == "z-up, metres, first person's first pelvis above the origin, floor at z=0"
    assert attributes["body_model"] == "body24"
    assert len(attributes["joint_names"]) == len(attributes["parents"]) == 24
    assert attributes["parents"][0] < 0
    assert attributes["cut_frames"] == [6]


def test_the_world_of_every_shot_and_person_is_written_and_read(tmp_path: Path, recording: Recording) -> None:
    write_motion(tmp_path / "motion.zarr", dataclasses.replace(recording, worlds=(0, 1)))
    group = zarr.open_group(tmp_path / "motion.zarr", mode="r")
    assert group.attrs["shots"] == [{"start": 0, "end": 6, "world": 0}, {"start": 6, "end": 12, "world": 1}]
    assert group["people/00"].attrs["world"] == 0
    assert read_motion(tmp_path / "motion.zarr").worlds == (0, 1)


def test_reading_gives_back_what_was_written(tmp_path: Path, recording: Recording) -> None:
    write_motion(tmp_path / "motion.zarr", recording)
    again = read_motion(tmp_path / "motion.zarr")
    for field in dataclasses.fields(recording):
        if field.name != "people":
            np.testing.assert_array_equal(getattr(again, field.name), getattr(recording, field.name))
    for person, other in zip(recording.people, again.people, strict=True):
        for field in dataclasses.fields(person):
            np.testing.assert_array_equal(getattr(other, field.name), getattr(person, field.name))


def test_a_changed_byte_is_an_error_not_another_motion(tmp_path: Path, recording: Recording) -> None:
    write_motion(tmp_path / "motion.zarr", recording)
    (chunk,) = [p for p in (tmp_path / "motion.zarr/people/00/joints/c").rglob("*") if p.is_file()]
    damaged = bytearray(chunk.read_bytes())
    damaged[len(damaged) // 2] ^= 1
    chunk.write_bytes(bytes(damaged))
    with pytest.raises(InputError, match="damaged"):
        read_motion(tmp_path / "motion.zarr")


@pytest.mark.parametrize(
    "gone", ["people/00/joints/c", "people/00/joints", "people/00/zarr.json", "people/00", "people", "shot_index/c"]
)
def test_what_is_missing_is_an_error_and_no_zeros(tmp_path: Path, recording: Recording, gone: str) -> None:
    """Zarr itself reads zeros for a chunk that is not there: a copy that broke off gave bodies in their rest pose."""
    write_motion(tmp_path / "motion.zarr", recording)
    path = tmp_path / "motion.zarr" / gone
    path.unlink() if path.is_file() else shutil.rmtree(path)
    with pytest.raises(InputError, match="damaged"):
        read_motion(tmp_path / "motion.zarr")


def test_an_empty_file_in_place_of_the_root_is_damage(tmp_path: Path, recording: Recording) -> None:
    write_motion(tmp_path / "motion.zarr", recording)
    (tmp_path / "motion.zarr/zarr.json").write_text("")
    with pytest.raises(InputError, match="damaged"):
        read_motion(tmp_path / "motion.zarr")


def test_a_recording_of_an_earlier_version_without_files_for_zeros_is_read(
    tmp_path: Path, recording: Recording
) -> None:
    write_motion(tmp_path / "motion.zarr", recording)
    del zarr.open_group(tmp_path / "motion.zarr", mode="r+").attrs["people"]
    shutil.rmtree(tmp_path / "motion.zarr/shot_index/c")
    assert not read_motion(tmp_path / "motion.zarr").shot_index.any()


def test_a_folder_of_another_schema_is_refused(tmp_path: Path, recording: Recording) -> None:
    write_motion(tmp_path / "motion.zarr", recording)
    zarr.open_group(tmp_path / "motion.zarr", mode="r+").attrs["schema"] = "humanmm.motion/9"
    with pytest.raises(InputError, match=r"humanmm\.motion/9"):
        read_motion(tmp_path / "motion.zarr")


def test_a_writer_that_fails_leaves_the_old_recording(tmp_path: Path, recording: Recording) -> None:
    write_motion(tmp_path / "motion.zarr", recording)

    def fail(folder: Path) -> None:
        (folder / "half").write_text("half")
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        replace_folder(tmp_path / "motion.zarr", fail)
    assert read_motion(tmp_path / "motion.zarr").num_frames == 12
    assert [p.name for p in tmp_path.iterdir()] == ["motion.zarr"]


def test_the_run_folder_holds_motion_exports_and_pictures_and_nothing_of_people_who_are_gone(
    tmp_path: Path, recording: Recording
) -> None:
    blobs = tmp_path / "blobs"
    blobs.mkdir()
    (blobs / "top.png").write_bytes(b"picture")
    run_dir = tmp_path / "run"
    write_run_folder(run_dir, Delivery(recording, ("top.png",)), blobs)
    alone = dataclasses.replace(recording, people=recording.people[:1])
    write_run_folder(run_dir, Delivery(alone, ("top.png",)), blobs)
    assert sorted(str(p.relative_to(run_dir)) for p in run_dir.glob("*/*") if p.parent.name != "motion.zarr") == [
        "export/person_00.npz",
        "view/top.png",
    ]
    assert len(read_motion(run_dir / "motion.zarr").people) == 1


def test_what_a_killed_writer_left_is_swept_and_a_running_one_is_spared(tmp_path: Path) -> None:
    dead = tmp_path / f".writing-{_unused_pid()}-0-motion.zarr"
    dead.mkdir()
    alive = tmp_path / f".writing-{os.getpid()}-0-motion.zarr"
    alive.mkdir()
    own = tmp_path / ".writing-notes.txt"
    own.write_text("the user's own")
    sweep(tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([alive.name, own.name])


def _unused_pid() -> int:
    pid = os.fork()
    if pid == 0:
        os._exit(0)
    os.waitpid(pid, 0)
    return pid


def test_hands_are_stored_with_the_names_of_their_joints_and_come_back(tmp_path: Path, recording: Recording) -> None:
    hands = with_hands(recording)
    write_motion(tmp_path / "motion.zarr", hands)
    group = zarr.open_group(tmp_path / "motion.zarr", mode="r")
    array = group["people/00/hand_pose"]
    assert isinstance(array, zarr.Array) and array.shape == (N, 30, 3)
    assert list(array.attrs["joint_names"])[:4] == ["L_Index1", "L_Index2", "L_Index3", "L_Middle1"]  # type: ignore[arg-type]
    again = read_motion(tmp_path / "motion.zarr")
    for found, person in zip(again.people, hands.people, strict=True):
        np.testing.assert_array_equal(found.hand_pose, person.hand_pose)
        np.testing.assert_array_equal(found.hand_confidence, person.hand_confidence)


def test_hands_that_are_missing_are_an_error_and_nobody_without_hands(tmp_path: Path, recording: Recording) -> None:
    write_motion(tmp_path / "motion.zarr", with_hands(recording))
    shutil.rmtree(tmp_path / "motion.zarr/people/00/hand_pose")
    with pytest.raises(InputError, match="damaged"):
        read_motion(tmp_path / "motion.zarr")
