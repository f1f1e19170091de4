"""What `humanmm recover` says, where it writes, and with which status it ends."""

import json
import os
import subprocess
import sys
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest
from terminal import on_terminal

from humanmm.cli import main


def _reported(answer: tuple[int, str, str], status: int) -> str:
    """The one plain line on standard error of a command that ended with this status and printed nothing else."""
    assert answer[0] == status, answer
    assert answer[1] == ""
    lines = answer[2].splitlines()
    assert len(lines) == 1 and lines[0].startswith("humanmm: "), lines
    return lines[0]


def _left(toy: Any) -> set[str]:
    return {path.name for path in toy.folder.iterdir()} - {"toyline", "film.mp4", "store"}


@pytest.mark.parametrize(
    ("name", "make", "message"),
    [
        ("missing.mp4", lambda path: None, "no such video: "),
        ("folder.mp4", lambda path: path.mkdir(), "is a folder without a video"),
        ("empty.mp4", lambda path: path.touch(), "is empty"),
    ],
)
def test_what_is_no_video_is_reported_in_one_line_and_nothing_is_left(
    toy: Any, name: str, make: Any, message: str
) -> None:
    make(toy.folder / name)
    assert message in _reported(toy.main("recover", name, "--out", "out"), 1)
    assert _left(toy) <= {name}


@pytest.mark.usefixtures("server_cache")
def test_text_renamed_to_mp4_is_reported_by_the_real_decoder_and_nothing_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "notes.mp4").write_text("these are notes\n" * 100)
    status = main(["recover", "notes.mp4", "--out", "out", "--store", "store"])
    _reported((status, *capfd.readouterr()), 1)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[people]\nmax_peeple = 3\n", "unknown setting people.max_peeple; did you mean max_people?"),
        ("[peopel]\nmax_people = 3\n", "unknown setting peopel; did you mean people?"),
        ("[people]\nmax_people = 0\n", "setting people.max_people: input should be greater than or equal to 1, not 0"),
        ("[camera]\nstatic = 'perhaps'\n", "setting camera.static: input should be a valid boolean"),
        ("[camera\n", "is not TOML"),
        ("camera = 3\n", "setting camera: "),
    ],
)
def test_a_bad_settings_file_is_reported_in_one_line(toy: Any, text: str, message: str) -> None:
    (toy.folder / "settings.toml").write_text(text)
    line = _reported(toy.main("recover", "film.mp4", "--config", "settings.toml"), 1)
    assert message in line and "settings.toml" in line
    assert _left(toy) == {"settings.toml"}


def test_a_settings_file_that_is_not_there_is_reported(toy: Any) -> None:
    line = _reported(toy.main("recover", "film.mp4", "--config", "none.toml"), 1)
    assert "cannot read the settings file none.toml" in line


@pytest.mark.parametrize(
    "arguments",
    [
        ["--people.max_people", "0"],
        ["--people.max-people", "many"],
        ["--focal-px", "-3"],
        ["--only", "hmr", "--from", "camera"],
        ["--shot", "1"],
        ["--json"],
    ],
)
def test_a_bad_flag_is_a_usage_error_in_one_line(toy: Any, arguments: list[str]) -> None:
    _reported(toy.main("recover", "film.mp4", *arguments), 2)
    assert not toy.store.exists() or not list(toy.store.glob("artifacts"))


@pytest.mark.parametrize(
    "arguments",
    [
        ["--people.max_peeple", "3"],
        ["--max-people", "3"],
        ["--only", "nothing"],
        ["--person", "first"],
        ["--focal-px", "3", "--fov-deg", "4"],
        ["--dry"],
    ],
)
def test_an_unknown_flag_is_a_usage_error(toy: Any, arguments: list[str]) -> None:
    status, out, message = toy.main("recover", "film.mp4", *arguments)
    assert (status, out) == (2, "")
    assert "Traceback" not in message


def test_flags_win_over_the_file_and_the_file_over_defaults(toy: Any) -> None:
    (toy.folder / "settings.toml").write_text("[camera]\nstatic = true\n[people]\nmax_people = 5\n")
    toy.run(camera={"static": True}, people={"max_people": 4}, shots={"person": 0}, intrinsics={"focal_px": 900.0})
    status, out, _ = toy.main(
        "recover", "film.mp4", "--config", "settings.toml", "--people.max-people", "4", "--person", "0", "--focal-px",
        "900", "--dry-run", "--json",
    )  # fmt: skip
    assert status == 0
    assert {entry["state"] for entry in json.loads(out)["stages"]} == {"cached"}


def test_files_of_other_programs_are_part_of_the_key_by_their_content_and_stand_in_run_json(toy: Any) -> None:
    given, cameras = toy.folder / "keypoints.json", toy.folder / "way.tum"
    given.write_text("[]")
    cameras.write_text("0 0 0 0 0 0 0 1\n")
    flags = ["--keypoints-from", "keypoints.json", "--cameras-from", "way.tum", "--min-confidence", "0.3"]
    toy.run(
        people={"keypoints_from": str(given)}, intrinsics={"cameras_from": str(cameras)}, shots={"min_confidence": 0.3}
    )
    toy.executed()
    assert toy.main("recover", "film.mp4", "--out", "out", *flags)[0] == 0
    assert toy.executed() == []
    config = json.loads((toy.folder / "out/run.json").read_text())["config"]
    assert config["people"]["keypoints_from"] == {"path": str(given), "sha256": sha256(b"[]").hexdigest()}
    assert config["intrinsics"]["cameras_from"]["path"] == str(cameras)
    given.write_text("[{}]")
    status, out, _ = toy.main("recover", "film.mp4", "--dry-run", "--json", *flags)
    states = {(entry["stage"], entry["state"]) for entry in json.loads(out)["stages"]}
    assert status == 0 and ("people", "cached") not in states
    assert {("decode", "cached"), ("scenes", "cached"), ("points", "cached")} <= states
    assert "cannot read" in _reported(toy.main("recover", "film.mp4", "--keypoints-from", "nowhere"), 2)


@pytest.mark.parametrize("flag", ["hmr", "detections", "masks"])
def test_what_finds_people_elsewhere_is_part_of_the_key_and_comes_alone(toy: Any, flag: str) -> None:
    given, other = toy.folder / "given.txt", toy.folder / "keypoints.json"
    given.write_text("1,1,10,10,20,40,1\n")
    other.write_text("[]")
    toy.run(people={f"{flag}_from": str(given)})
    toy.executed()
    assert toy.main("recover", "film.mp4", "--out", "out", f"--{flag}-from", "given.txt")[0] == 0
    assert toy.executed() == []
    config = json.loads((toy.folder / "out/run.json").read_text())["config"]
    assert config["people"][f"{flag}_from"]["sha256"] == sha256(given.read_bytes()).hexdigest()
    both = toy.main("recover", "film.mp4", f"--{flag}-from", "given.txt", "--keypoints-from", "keypoints.json")
    assert f"keypoints_from and {flag}_from exclude each other" in _reported(both, 2)


def test_numbers_of_people_are_trusted_only_where_some_are_given(toy: Any) -> None:
    told = toy.main("recover", "film.mp4", "--people.trust-numbers", "true")
    assert "trust_numbers is about the numbers of people in detections_from or masks_from" in _reported(told, 2)
    (toy.folder / "given.txt").write_text("1,1,10,10,20,40,1\n")
    trusted = ("--detections-from", "given.txt", "--people.trust-numbers", "true", "--out", "out")
    assert toy.main("recover", "film.mp4", *trusted)[0] == 0


def test_hands_are_part_of_the_key_and_need_our_own_pose_network(toy: Any) -> None:
    toy.run()
    toy.executed()
    _, out, _ = toy.main("recover", "film.mp4", "--hands", "--dry-run", "--json")
    assert ("people", "cached") not in {(entry["stage"], entry["state"]) for entry in json.loads(out)["stages"]}
    toy.run(people={"hands": True})
    toy.executed()
    assert toy.main("recover", "film.mp4", "--hands", "--out", "out")[0] == 0
    assert toy.executed() == []
    (toy.folder / "keypoints.json").write_text("[]")
    both = toy.main("recover", "film.mp4", "--hands", "--keypoints-from", "keypoints.json")
    assert "leave hands out with keypoints_from" in _reported(both, 2)


def test_a_dry_run_lists_every_unit_and_writes_nothing(toy: Any) -> None:
    toy.run()
    before = sorted(toy.folder.rglob("*"))
    status, out, message = toy.main("recover", "film.mp4", "--dry-run", "--camera.static", "true")
    assert (status, message) == (0, "")
    lines = {f"{line.split()[0]}|{line[11:24].strip()}": line for line in out.splitlines()}
    assert len(lines) == 18
    assert lines["camera|shot 1"].endswith("will run: setting changed: camera.static False → True")
    assert lines["hmr|shot 1"].endswith("depends on camera's result")
    assert lines["points|scene 1"].endswith("cached")
    assert sorted(toy.folder.rglob("*")) == before


HOSTILE_NAMES = {
    " two  spaces.mp4": "_two__spaces",
    "'single' \"double\".mp4": "_single___double_",
    "new\nline.mp4": "new_line",
    "..mp4": "video",
    "ünï 映画.mp4": "ünï_映画",
    "-dash;$(touch x)`.mp4": "-dash___touch_x__",
    "..\\..\\up.mkv": "_.._up",
    "x" * 200 + ".mp4": "x" * 120,
}
"""File names, and the run folders that they become."""


def test_hostile_file_names_work_and_the_last_line_is_the_folder(toy: Any) -> None:
    toy.run()
    video = toy.video
    for name, stem in HOSTILE_NAMES.items():
        video = video.rename(toy.folder / name)
        status, out, _ = toy.main("recover", f"./{name}")
        assert (status, out) == (0, f"runs/{stem}\n")
        record = json.loads((toy.folder / out.strip() / "run.json").read_text())
        assert record["video"]["path"] == str(toy.folder / name)
    assert toy.main("recover", f"./{name}")[2].endswith("were in the store\n")


def test_a_name_that_is_no_text_works(toy: Any) -> None:
    toy.run()
    name = os.fsdecode(b"\xff\xfe.mp4")
    toy.video.rename(toy.folder / name)
    command = toy.command_line("recover", name, "--out", "out")
    done = subprocess.run(command, cwd=toy.folder, env=toy.environment(), capture_output=True, check=False)
    assert (done.returncode, done.stdout) == (0, b"out\n"), done.stderr


def test_a_finished_video_is_answered_without_loading_anything_heavy(toy: Any) -> None:
    toy.run()
    assert toy.main("recover", "film.mp4")[0] == 0
    script = (
        "import sys\n"
        "from humanmm.cli import main\n"
        "from humanmm.tasks import pipeline\n"
        "from toyline.table import STAGES\n"
        "pipeline.STAGES = STAGES\n"
        "assert main(['recover', 'film.mp4']) == 0\n"
        "heavy = {'prefect', 'torch', 'cv2', 'av', 'scipy', 'zarr', 'pycolmap', 'matplotlib', 'ai_edge_litert'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=toy.folder, env=toy.environment(),
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout == "runs/film\n"


def test_a_run_folder_that_lost_something_is_written_again_from_the_store(toy: Any) -> None:
    toy.run()
    toy.main("recover", "film.mp4")
    (toy.folder / "runs/film/view/overlay.mp4").unlink()
    (toy.folder / "runs/film/motion.zarr/time_s/zarr.json").unlink()
    toy.executed()
    status, _, message = toy.main("recover", "film.mp4")
    assert status == 0 and "written from the store" in message
    assert (toy.folder / "runs/film/view/overlay.mp4").exists()
    assert (toy.folder / "runs/film/motion.zarr/time_s/zarr.json").exists()
    assert toy.executed() == []


def test_several_videos_and_folders_are_recovered_one_after_the_other(toy: Any) -> None:
    folder = toy.folder / "clips" / "day"
    folder.mkdir(parents=True)
    for name in ("a.mp4", "film.mp4"):
        (folder / name).write_bytes(toy.video.read_bytes())
    (folder / "broken.mp4").touch()
    toy.run()
    status, out, message = toy.main("recover", "film.mp4", "clips", "clips/day/a.mp4", "--out", "results")
    lines = out.split()
    assert lines[:2] == ["results/film", "results/a"] and lines[2].startswith("results/film-"), "each once"
    assert status == 1, "one of them is no video"
    assert "humanmm: 1 of 4, film.mp4: done: 1 person, 3 shots" in message
    assert "humanmm: 3 of 4, clips/day/broken.mp4: " in message and "is empty" in message
    assert all((toy.folder / line / "run.json").is_file() for line in lines)
    (folder / "broken.mp4").unlink()
    assert toy.main("recover", "film.mp4", "clips", "--out", "results")[0] == 0


def test_a_dry_run_of_several_videos_names_them(toy: Any) -> None:
    (toy.folder / "other.mp4").write_text(json.dumps({"num_frames": 40, "cuts": [20]}))
    toy.run()
    before = sorted(toy.folder.rglob("*"))
    status, out, _ = toy.main("recover", "film.mp4", "other.mp4", "--dry-run")
    assert status == 0 and "film.mp4:\n" in out and "other.mp4:\n" in out
    trees = json.loads(toy.main("recover", "film.mp4", "other.mp4", "--dry-run", "--json")[1])["videos"]
    assert [tree["video"] for tree in trees] == ["film.mp4", "other.mp4"]
    assert sorted(toy.folder.rglob("*")) == before


def test_a_dry_run_of_several_videos_marks_broken_ones_and_lists_the_others(toy: Any) -> None:
    (toy.folder / "clips").mkdir()
    (toy.folder / "clips" / "empty.mp4").touch()
    (toy.folder / "clips" / "film.mp4").write_bytes(toy.video.read_bytes())
    toy.run()
    status, out, _ = toy.main("recover", "clips", "--dry-run")
    empty = f"{toy.folder / 'clips/empty.mp4'} is empty (0 bytes)"
    assert status == 1 and f"clips/empty.mp4:\nerror: {empty}\nclips/film.mp4:\ndecode" in out
    status, out, _ = toy.main("recover", "clips", "--dry-run", "--json")
    first, second = json.loads(out)["videos"]
    assert status == 1 and first == {"video": "clips/empty.mp4", "error": empty} and len(second["stages"]) == 18
    assert "is empty" in _reported(toy.main("recover", "clips/empty.mp4", "--dry-run"), 1)


def test_a_pipe_gets_the_path_alone_and_a_line_of_what_to_look_at(toy: Any) -> None:
    toy.run()
    (toy.folder / "runs").mkdir()
    status, out, message = toy.main("recover", "film.mp4", "--hmr.smoothness", "2")
    assert (status, out) == (0, "runs/film\n")
    (line,) = message.splitlines()
    assert line.startswith("humanmm: done: 1 person, 3 shots, ") and "run.json" in line


def test_a_terminal_gets_five_lines(toy: Any) -> None:
    toy.run()
    session = on_terminal(toy.command_line("recover", "film.mp4"), cwd=toy.folder, env=toy.environment())
    assert session.status == 0
    lines = [line for line in session.last_lines if not line.startswith("humanmm: ")]
    assert [line.split()[0] for line in lines] == ["people", "shots", "sure", "look", "result"]
    assert "focal" in lines[2] and "scale" in lines[2] and "floor" in lines[2]
    assert "runs/film" in lines[4]


def test_an_output_folder_that_cannot_be_made_is_reported_before_anything_runs(toy: Any) -> None:
    (toy.folder / "file").write_text("mine")
    assert "is a file" in _reported(toy.main("recover", "film.mp4", "--out", "file/run"), 1)
    assert toy.executed() == []
    assert (toy.folder / "file").read_text() == "mine"


def test_a_folder_without_the_right_to_write_is_reported_before_anything_runs(toy: Any) -> None:
    if os.geteuid() == 0:
        pytest.skip("root may write everywhere")
    locked = toy.folder / "locked"
    locked.mkdir(mode=0o500)
    assert "not writable" in _reported(toy.main("recover", "film.mp4", "--out", "locked/run"), 1)
    assert "permission denied" in _reported(toy.main("recover", "film.mp4", "--store", "locked/store"), 1)
    assert toy.executed() == []


def test_a_store_that_cannot_be_made_is_reported(toy: Any) -> None:
    (toy.folder / "file").write_text("mine")
    assert "a part of the path is a file" in _reported(toy.main("recover", "film.mp4", "--store", "file/store"), 1)


def test_a_store_and_a_folder_where_nobody_can_make_one_are_reported(toy: Any) -> None:
    line = _reported(toy.main("recover", "film.mp4", "--store", "/proc/nope"), 1)
    assert "in the store /proc/nope: " in line and "; name a" in line
    line = _reported(toy.main("recover", "film.mp4", "--out", "/proc/nope"), 1)
    assert "the output folder /proc/nope is not writable: " in line and "name another with --out" in line
    assert toy.executed() == []


def test_help_names_every_setting_with_its_sentence_and_no_verb_that_is_missing(toy: Any) -> None:
    status, out, _ = toy.main("recover", "--help")
    assert status == 0
    assert "--camera.static" in out and "--people.max_people" in out and "--deliver.overlay_max_side_px" in out
    status, out, _ = toy.main("--help")
    for verb in ("recover", "batch", "serve", "status", "explain", "verify", "gc", "store", "doctor", "eval"):
        assert verb in out
    for later in ("camera VIDEO",):
        assert later not in out


def test_a_folder_does_not_give_the_films_of_runs_in_it(toy: Any) -> None:
    toy.run()
    for _ in range(2):
        assert toy.main("recover", ".")[:2] == (0, "runs/film\n")
    assert (toy.folder / "runs/film/view/overlay.mp4").is_file()


def test_another_video_of_the_same_name_gets_its_own_folder_and_no_corrections_of_the_first(toy: Any) -> None:
    toy.run()
    toy.main("recover", "film.mp4")
    assert toy.main("correct", "runs/film", "floor", "--lower", "0.4")[0] == 0
    (toy.folder / "b").mkdir()
    toy.video = toy.video.rename(toy.folder / "first.mp4")
    other = toy.folder / "b" / "film.mp4"
    other.write_text(json.dumps({"num_frames": 61, "cuts": [20, 40]}))
    toy.video = other
    toy.run()
    digits = sha256(other.read_bytes()).hexdigest()[:8]
    for _ in range(2):
        status, out, _ = toy.main("recover", "b/film.mp4")
        assert (status, out) == (0, f"runs/film-{digits}\n")
    assert json.loads((toy.folder / out.strip() / "run.json").read_text())["corrections"] == []
    line = _reported(toy.main("recover", "b/film.mp4", "--out", "runs/film"), 1)
    assert "runs/film holds the run of another video with corrections; name another folder" in line
    assert toy.main("recover", "b/film.mp4", "--out", "runs/film", "--dry-run")[0] == 1
    (toy.folder / "first.mp4").rename(toy.folder / "b" / "film.mp4")
    assert "refine" in toy.main("recover", "b/film.mp4", "--dry-run")[1]
    assert "1 correction of runs/film/corrections.toml" in toy.main("recover", "b/film.mp4", "--dry-run")[2]


def test_corrections_of_another_video_are_left_aside_and_said_and_no_more_are_added(toy: Any) -> None:
    toy.run()
    toy.main("recover", "film.mp4")
    path = toy.folder / "runs/film/corrections.toml"
    path.write_text('video = "ab12"\n[[correction]]\nkind = "floor"\nmetres = 0.5\n')
    status, _, message = toy.main("recover", "film.mp4")
    assert status == 0 and "warning: correction 1 does not fit " in message and "written for another video" in message
    assert "[does not fit: it was written for another" in toy.main("correct", "runs/film")[1]
    line = _reported(toy.main("correct", "runs/film", "add-cut", "50"), 1)
    assert "was written for another video than that of the run; move it away first" in line
