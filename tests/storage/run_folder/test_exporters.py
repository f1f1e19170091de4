"""Files for other people's tools: which there are, what is refused, what of a replaced motion goes away."""

import dataclasses
import logging
from pathlib import Path

import pytest
import two_people

from humanmm.cli.results import FORMATS as OFFERED
from humanmm.errors import InputError
from humanmm.models.motion.excerpt import Wishes
from humanmm.models.records.recording import Delivery, Recording
from humanmm.storage.run_folder.exporters import FORMATS, always_written, export
from humanmm.storage.run_folder.motion_zarr import write_run_folder


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


EVERYWHERE = [name for name in FORMATS if name not in ("amass", "fbx", "usd", "c3d")]
"""Formats that need no program or package beside humanmm."""


@pytest.mark.parametrize("name", EVERYWHERE)
def test_an_export_is_not_overwritten_unrequested(tmp_path: Path, name: str, recording: Recording) -> None:
    first = export(recording, tmp_path, name)
    before = [path.read_bytes() for path in first]
    with pytest.raises(InputError, match="--force"):
        export(recording, tmp_path, name)
    assert export(recording, tmp_path, name, force=True) == first
    assert [path.read_bytes() for path in first] == before, "the same bytes for the same recording"


def test_an_unknown_format_names_those_that_exist(tmp_path: Path, recording: Recording) -> None:
    with pytest.raises(InputError, match="amass"):
        export(recording, tmp_path, "blend")


@pytest.mark.parametrize(
    ("name", "wishes", "words"),
    [
        ("glb", Wishes(up="z"), "glTF is y up and in metres"),
        ("amass", Wishes(unit="cm"), "expect z up and metres"),
        ("colmap", Wishes(fps=30.0), "leave --fps out"),
        ("csv", Wishes(keep_unseen=True), r"csv hides nobody: leave --keep-unseen out \(it is for glb, fbx, usd\)"),
        ("bvh", Wishes(start_s=0.0, end_s=0.1, people=(1,)), "nobody is in these frames"),
    ],
)
def test_what_a_format_cannot_do_is_refused_in_one_sentence(
    tmp_path: Path, name: str, wishes: Wishes, words: str
) -> None:
    with pytest.raises(InputError, match=words):
        export(two_people.recording(), tmp_path, name, wishes=wishes)
    assert not list(tmp_path.iterdir())


def test_a_format_may_be_written_in_its_own_axes_and_unit(tmp_path: Path) -> None:
    assert export(two_people.recording(), tmp_path, "glb", wishes=Wishes(up="y", unit="m"))


@pytest.mark.parametrize("name", EVERYWHERE)
def test_people_span_and_rate_reach_every_format(tmp_path: Path, name: str) -> None:
    fps = None if name == "colmap" else 60.0
    paths = export(two_people.recording(), tmp_path, name, wishes=Wishes(people=(1,), start_s=0.3, end_s=1.0, fps=fps))
    assert paths and all(path.stat().st_size for path in paths)
    assert not list(tmp_path.glob("person_00*"))


def test_exports_of_a_motion_that_was_replaced_go_away_and_other_files_stay(
    tmp_path: Path, recording: Recording, caplog: pytest.LogCaptureFixture
) -> None:
    run_dir, blobs = tmp_path / "run", tmp_path / "blobs"
    folder = run_dir / "export"
    write_run_folder(run_dir, Delivery(recording, ()), blobs)
    for name in EVERYWHERE:
        export(recording, folder, name)
    (folder / "person_07.bvh").write_text("somebody's own")
    with caplog.at_level(logging.WARNING):
        write_run_folder(run_dir, Delivery(recording, ()), blobs)
    assert (folder / "scene.glb").exists() and (folder / "colmap").is_dir() and not caplog.records, "it is the same"
    moved = dataclasses.replace(recording, t_world_cam=recording.t_world_cam + 1)
    with caplog.at_level(logging.WARNING):
        write_run_folder(run_dir, Delivery(moved, ()), blobs)
    assert sorted(path.name for path in folder.iterdir()) == ["person_00.npz", "person_01.npz", "person_07.bvh"]
    assert "scene.glb" in caplog.text


def test_files_of_people_who_are_gone_go_away_whatever_their_number(tmp_path: Path, recording: Recording) -> None:
    one, other = recording.people
    many = dataclasses.replace(recording, people=(one, dataclasses.replace(other, person=100)))
    write_run_folder(tmp_path, Delivery(many, ()), tmp_path / "blobs")
    (tmp_path / "export" / "person_left.npz").write_text("somebody's own")
    assert [path.name for path in sorted(always_written(tmp_path / "export"))] == ["person_00.npz", "person_100.npz"]
    write_run_folder(tmp_path, Delivery(recording, ()), tmp_path / "blobs")
    assert sorted(path.name for path in (tmp_path / "export").iterdir()) == [
        "person_00.npz", "person_01.npz", "person_left.npz",
    ]  # fmt: skip
