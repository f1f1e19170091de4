"""`humanmm export`, `view` and `bench` as a user types them."""

import webbrowser
from pathlib import Path

import numpy as np
import pytest

from humanmm.cli import main
from humanmm.models.records.recording import RecordedPerson, Recording
from humanmm.storage.run_folder.motion_zarr import write_motion


@pytest.fixture
def run_dir(tmp_path: Path) -> Path:
    """A run folder that holds a motion and nothing else."""
    n = 3
    person = RecordedPerson(
        person=0,
        frame=np.arange(n, dtype=np.int32),
        observed=np.ones(n, bool),
        root_orient=np.zeros((n, 3), np.float32),
        body_pose=np.zeros((n, 23, 3), np.float32),
        betas=np.zeros(10, np.float32),
        transl=np.zeros((n, 3), np.float32),
        joints=np.zeros((n, 24, 3), np.float32),
        contacts=np.zeros((n, 4), np.float32),
        keypoints2d=np.zeros((n, 33, 3), np.float32),
        bbox=np.zeros((n, 4), np.float32),
        confidence=np.ones(n, np.float32),
    )
    recording = Recording(
        width=64,
        height=48,
        time_s=np.arange(n) / 30,
        shot_index=np.zeros(n, np.int32),
        cut_frames=(),
        R_world_cam=np.tile(np.eye(3, dtype=np.float32), (n, 1, 1)),
        t_world_cam=np.zeros((n, 3), np.float32),
        K=np.tile(np.eye(3, dtype=np.float32), (n, 1, 1)),
        camera_source=np.zeros(n, np.uint8),
        people=(person,),
    )
    write_motion(tmp_path / "run" / "motion.zarr", recording)
    return tmp_path / "run"


def test_export_says_where_the_file_is(run_dir: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", str(run_dir), "--format", "csv"]) == 0
    path = run_dir / "export" / "person_00.csv"
    assert capsys.readouterr().out.splitlines()[-1] == str(path)
    assert path.is_file()


def test_export_takes_people_span_rate_axes_unit_and_folder(
    run_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wishes = ["--person", "0", "--start", "0.03", "--end", "1", "--fps", "60", "--up", "z", "--unit", "m"]
    assert main(["export", str(run_dir), "--format", "bvh", *wishes, "--out", str(tmp_path / "out")]) == 0
    text = (tmp_path / "out" / "person_00.bvh").read_text()
    assert "Frames: 3\nFrame Time: 0.016666667" in text and not (run_dir / "export").exists()
    capsys.readouterr()
    assert main(["export", str(run_dir), "--format", "csv", "--person", "0", "--person", "7"]) == 1
    assert capsys.readouterr().err == "humanmm: there is no person 7; the run has 0\n"
    assert main(["export", str(run_dir), "--format", "csv", "--up", "x"]) == 2


def test_export_writes_every_format_that_is_named(run_dir: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", str(run_dir), "--format", "bvh", "--format", "csv", "--format", "bvh"]) == 0
    written = [Path(line).name for line in capsys.readouterr().out.splitlines()]
    assert written == ["person_00.bvh", "person_00.csv"]
    assert all((run_dir / "export" / name).is_file() for name in written)


def test_export_refuses_to_overwrite_in_one_plain_line(run_dir: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["export", str(run_dir), "--format", "trc"])
    capsys.readouterr()
    assert main(["export", str(run_dir), "--format", "trc"]) == 1
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert main(["export", str(run_dir), "--format", "trc", "--force"]) == 0


def test_a_file_in_the_place_of_the_folder_is_reported_in_one_plain_line(
    run_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "file"
    file.write_text("mine")
    for out in (file, file / "deeper"):
        assert main(["export", str(run_dir), "--format", "csv", "--out", str(out), "--force"]) == 1
        sentence = f"the output folder {out} cannot be made: {file} is a file; name another with --out"
        assert capsys.readouterr().err == f"humanmm: {sentence}\n"
    assert file.read_text() == "mine"


def test_a_format_that_does_not_exist_is_a_usage_error(run_dir: Path) -> None:
    assert main(["export", str(run_dir), "--format", "blend"]) == 2


@pytest.mark.parametrize("verb", [["view"], ["export", "--format", "amass"]])
def test_a_folder_that_is_no_run_is_reported_in_one_line(
    tmp_path: Path, verb: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*verb, str(tmp_path)]) == 1
    assert str(tmp_path) in capsys.readouterr().err


def test_bench_refuses_a_video_that_is_not_there_and_a_report_that_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    missing = tmp_path / "missing.mp4"
    assert main(["bench", "speed", "--data", str(missing)]) == 1
    (tmp_path / "results.json").write_text("{}")
    assert main(["bench", "speed", "--data", str(missing), "--report", str(tmp_path)]) == 1
    assert "--force" in capsys.readouterr().err.splitlines()[-1]


def test_view_opens_the_page_for_who_sits_at_a_terminal_with_a_screen_alone(
    run_dir: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    monkeypatch.setattr("humanmm.results.Run.draw", lambda run, *, force: (run.folder / "view" / "top.png",))
    page = run_dir / "view" / "scene.html"
    page.parent.mkdir()
    page.write_text("the page")
    monkeypatch.setenv("DISPLAY", ":0")
    assert main(["view", str(run_dir)]) == 0
    assert capsys.readouterr().out.splitlines() == [str(page.with_name("top.png")), str(page)]
    assert opened == [], "standard output is no terminal"
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    assert main(["view", str(run_dir), "--no-open"]) == 0 and opened == []
    assert main(["view", str(run_dir)]) == 0 and opened == [page.as_uri()]


@pytest.mark.parametrize("wrong", [["--mp4", "world", "--rerun"], ["--mp4", "sideways"], ["--opacity", "2"]])
def test_what_view_cannot_write_is_a_usage_error(run_dir: Path, wrong: list[str]) -> None:
    assert main(["view", str(run_dir), *wrong]) == 2
