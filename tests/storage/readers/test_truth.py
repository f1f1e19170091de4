"""Truth files and run folders, ours and others', whole and broken."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from humanmm.errors import TruthError
from humanmm.models.evaluation import truth
from humanmm.models.evaluation.evaluate import evaluate
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.records import foreign_arrays
from humanmm.models.records.recording import Recording
from humanmm.models.records.sequence import MotionSequence
from humanmm.storage.readers.truth import read_boxes, read_sequence, read_truth
from humanmm.storage.run_folder.motion_zarr import write_motion

CLIP_A = Path(__file__).parents[3] / "examples" / "pose2sim_multishot" / "pose2sim_A_01-02-01_gt.npz"


@pytest.fixture
def npz(tmp_path: Path, recording: Recording) -> dict[str, np.ndarray]:
    """The recording as an npz truth's arrays."""
    arrays = {
        "fps": np.array(recording.fps),
        "num_frames": np.array(recording.num_frames),
        "cut_frames": np.array(recording.cut_frames),
        "body_model": np.array("body24"),
        "cameras/R_world_cam": recording.R_world_cam,
        "cameras/t_world_cam": recording.t_world_cam,
        "cameras/K": recording.K,
    }
    for person in recording.people:
        for name in ("frame", "observed", "root_orient", "body_pose", "betas", "transl", "joints", "contacts", "bbox"):
            arrays[f"people/{person.person:02d}/{name}"] = getattr(person, name)
    return arrays


def save(path: Path, arrays: dict[str, np.ndarray]) -> Path:
    np.savez(path, **arrays)  # type: ignore[arg-type]
    return path


def same(one: MotionSequence, other: MotionSequence) -> bool:
    return all(
        np.array_equal(getattr(a, name), getattr(b, name))
        for a, b in zip(one.people, other.people, strict=True)
        for name in ("frame", "observed", "joints", "contacts")
    )


@pytest.mark.parametrize("turned", [False, True])
def test_a_truth_in_stored_pixels_is_brought_into_the_runs_square_ones(
    turned: bool, tmp_path: Path, recording: Recording, npz: dict[str, np.ndarray]
) -> None:
    width, height = recording.width, recording.height
    coded = width // 2, height
    stored = coded[::-1] if turned else coded
    video = {
        "width": width, "height": height, "coded_width": stored[0], "coded_height": stored[1],
        "rotation_deg": 270 if turned else 0,
    }  # fmt: skip
    run = tmp_path / "run"
    run.mkdir()
    (run / "run.json").write_text(json.dumps({"schema": "humanmm.run/1", "video": video}))
    half = np.array([0.5, 1.0, 1.0])
    npz["cameras/K"] = npz["cameras/K"] * half[:, None]
    for name in [name for name in npz if name.endswith("/bbox")]:
        npz[name] = npz[name] * half[[0, 1, 0, 1]]
    in_stored = save(tmp_path / "stored.npz", npz | {"width": np.array(coded[0]), "height": np.array(coded[1])})
    found = read_truth(in_stored, run)
    assert found.cameras is not None
    np.testing.assert_allclose(found.cameras.K, recording.K, rtol=1e-6)
    for one, person in zip(found.people, recording.people, strict=True):
        np.testing.assert_allclose(one.bbox_xyxy, person.bbox, rtol=1e-6)
    as_it_is = read_truth(save(tmp_path / "unsaid.npz", npz), run)
    assert as_it_is.cameras is not None and np.array_equal(as_it_is.cameras.K, npz["cameras/K"])


def test_a_run_folder_and_an_npz_of_the_same_arrays_are_the_same_sequence(
    tmp_path: Path, recording: Recording, npz: dict[str, np.ndarray]
) -> None:
    write_motion(tmp_path / "run" / "motion.zarr", recording)
    of_folder, of_npz = read_sequence(tmp_path / "run"), read_sequence(save(tmp_path / "truth.npz", npz))
    assert same(of_folder, of_npz)
    assert same(of_folder, read_sequence(tmp_path / "run" / "motion.zarr"))
    assert of_folder.transitions == of_npz.transitions == ((6, 6),)
    assert of_folder.people[1].body is not None
    assert of_folder.cameras is not None


def test_gradual_transitions_come_from_run_json(tmp_path: Path, recording: Recording) -> None:
    write_motion(tmp_path / "motion.zarr", recording)
    dissolve = {"type": "dissolve", "start": 4, "end": 9}
    shots = [{"start": 0, "end": 6, "transition": None}, {"start": 6, "end": 12, "transition": dissolve}]
    (tmp_path / "run.json").write_text(json.dumps({"shots": shots}))
    assert read_sequence(tmp_path).transitions == ((4, 9),)


def test_a_pose2sim_truth_is_rotated_upright() -> None:
    sequence = read_sequence(CLIP_A)
    person = sequence.people[0]
    ankles = [sequence.joint_names.index(name) for name in ("LAnkle", "RAnkle")]
    shoulders = [sequence.joint_names.index(name) for name in ("LShoulder", "RShoulder")]
    height = person.joints[:, shoulders, 2].mean() - person.joints[:, ankles, 2].mean()
    assert 1.1 < height < 1.6
    assert sequence.transitions == ((36, 36), (70, 70))
    assert person.observed.all()


def test_a_pose2sim_truth_projects_onto_its_own_detections() -> None:
    sequence = read_sequence(CLIP_A)
    with np.load(CLIP_A) as file:
        detected = file["openpose2d"][:, :17]
    wrists = detected[:, [9, 10], :2].mean(axis=1)
    boxes = sequence.people[0].bbox_xyxy
    assert boxes is not None
    inside = (wrists > boxes[:, :2] - 15) & (wrists < boxes[:, 2:] + 15)
    assert inside.mean() > 0.95


def test_clip_a_against_itself_is_perfect() -> None:
    report = evaluate(read_sequence(CLIP_A), read_sequence(CLIP_A))
    assert report.coverage == 1.0
    assert report.roe_deg == pytest.approx(0.0, abs=1e-6)
    assert report.wa_mpjpe100_mm == pytest.approx(0.0, abs=1e-6)
    assert report.cam_cut_rot_deg == pytest.approx([0.0, 0.0], abs=1e-6)


def test_the_root_turns_as_root_orient_says(tmp_path: Path, npz: dict[str, np.ndarray]) -> None:
    person = read_sequence(save(tmp_path / "t.npz", npz)).people[0]
    np.testing.assert_allclose(person.R_world_root, rotvec_to_rotmat(npz["people/00/root_orient"]))


def test_a_missing_file_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(TruthError, match="does not exist"):
        read_sequence(tmp_path / "nothing.npz")


def test_a_folder_without_motion_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TruthError, match=r"motion\.zarr/zarr\.json"):
        read_sequence(tmp_path)


def test_text_named_npz_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "t.npz"
    path.write_text("hello")
    with pytest.raises(TruthError, match=r"not an \.npz"):
        read_sequence(path)


def test_a_truncated_npz_is_refused(tmp_path: Path, npz: dict[str, np.ndarray]) -> None:
    path = save(tmp_path / "t.npz", npz)
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(TruthError):
        read_sequence(path)


def test_pickles_are_never_loaded(tmp_path: Path, npz: dict[str, np.ndarray]) -> None:
    npz["people/00/joints"] = np.array([{"a": 1}], dtype=object)
    with pytest.raises(TruthError, match="no pickles"):
        read_sequence(save(tmp_path / "t.npz", npz))


@pytest.mark.parametrize(
    ("key", "value", "sentence"),
    [
        ("people/00/joints", np.zeros((12, 24, 2)), "expected N×24×3"),
        ("people/00/joints", np.full((12, 24, 3), "x"), "expected numbers"),
        ("people/00/frame", np.arange(12)[::-1], "rise strictly"),
        ("people/00/frame", np.arange(12) + 5, "goes to frame 16; the frames end at 11"),
        ("cut_frames", np.array([6, 6]), "rising frame numbers"),
        ("cut_frames", np.array([0]), "rising frame numbers"),
        ("num_frames", np.array(-1), "num_frames is -1"),
        ("fps", np.array(np.nan), "fps is nan"),
        ("cameras/K", np.zeros((3, 3)), "expected 12×3×3"),
        ("num_frames", np.array([12, 3]), "num_frames has shape 2; expected a single number"),
        ("num_frames", np.array(11.5), "num_frames holds 11.5; expected whole numbers"),
        ("fps", np.array("x"), "fps has type <U1; expected numbers"),
        ("cut_frames", np.array([np.nan]), "cut_frames holds numbers that are not finite"),
        ("cut_frames", np.array(["a"]), "cut_frames has type <U1; expected numbers"),
        ("joint_names", np.array("x"), "expected a list of different names"),
        ("joint_names", np.array(["pelvis"] * 24), "expected a list of different names"),
        ("people/00/frame", np.arange(12) - 2, "people/00/frame holds the negative frame -2"),
        ("people/00/frame", np.r_[0, 0:11], "people/00/frame does not rise strictly: 0 follows 0"),
        ("people/00/root_orient", np.full((12, 3), np.nan), "root_orient holds numbers that are not finite"),
        ("cameras/R_world_cam", np.full((12, 3, 3), 7.0), "12 matrices that are no rotations, the first in row 0"),
        ("people/xx/joints", np.zeros((12, 24, 3)), "people are numbered people/00"),
        ("people/0/joints", np.zeros((12, 24, 3)), "people/0/joints: people are numbered people/00"),
        ("people/00/joints", np.full((12, 24, 3), 1e308), "joints holds 1e.308; expected numbers up to 1e.12"),
        ("people/00/root_orient", np.full((12, 3), -1e300), "root_orient holds -1e.300; expected numbers up to"),
        ("linked", np.array(["x"]), "linked has type <U1; expected numbers"),
        ("linked", np.array([np.nan]), "linked holds numbers that are not finite"),
        ("transitions", np.array([[9, 3]]), "the transitions .9, 3. disagree with the cuts 6"),
        ("transitions", np.array([[-4, 17]]), "the transitions .-4, 17. disagree with the cuts 6"),
        ("joint_names", np.array(["\x1b[31m" + "x" * 99_999] * 2), r"joint_names are '\\x1b\[31mx+\\u2026', "),
    ],
)
def test_what_is_wrong_is_named(
    tmp_path: Path, npz: dict[str, np.ndarray], key: str, value: np.ndarray, sentence: str
) -> None:
    with pytest.raises(TruthError, match=sentence) as caught:
        read_sequence(save(tmp_path / "t.npz", {**npz, key: value}))
    assert "t.npz" in str(caught.value)


def test_strange_arrays_are_named(tmp_path: Path) -> None:
    with pytest.raises(TruthError, match="found a, b"):
        read_sequence(save(tmp_path / "t.npz", {"a": np.zeros(1), "b": np.zeros(1)}))


@pytest.mark.parametrize("fps", [0.0, -5.0, np.nan, np.inf])
def test_a_pose2sim_truth_has_a_rate(tmp_path: Path, fps: float) -> None:
    with np.load(CLIP_A) as arrays, pytest.raises(TruthError, match=r"fps is .*; expected a positive number"):
        read_sequence(save(tmp_path / "t.npz", {**arrays, "fps": np.array(fps)}))


def test_small_numbers_count_for_the_memory_that_they_take_as_large_ones(
    tmp_path: Path, npz: dict[str, np.ndarray], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(foreign_arrays, "MAX_NUMBERS", 12 * 24 * 3 - 1)
    with pytest.raises(TruthError, match="people/00/joints holds 864 numbers; expected at most 863"):
        read_sequence(save(tmp_path / "t.npz", {**npz, "people/00/joints": np.zeros((12, 24, 3), np.int8)}))
    monkeypatch.undo()
    monkeypatch.setattr(truth, "MAX_NUMBERS", 22 * 24 * 3 - 1)
    with pytest.raises(TruthError, match="its people have more than 1,583 coordinates"):
        read_sequence(save(tmp_path / "t.npz", {**npz, "people/01/joints": np.zeros((10, 24, 3), np.int8)}))


def test_names_of_strangers_are_shortened_and_their_control_characters_shown(tmp_path: Path) -> None:
    strange = {"\x1b]0;title\x07": np.zeros(1), "k" * 50_000: np.zeros(1)}
    with pytest.raises(TruthError) as raised:
        read_sequence(save(tmp_path / "t.npz", strange))
    assert str(raised.value).isprintable() and len(str(raised.value)) < 600


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("[" * 200_000, "is not json, or holds lists in lists without end"),
        ("{", "is not json"),
        ("[]", "has no list of shots"),
        ('{"shots": 5}', "has no list of shots"),
        ('{"shots": [1, 2]}', "shot 1 of run.json is no table with a start"),
        ('{"shots": [{}, {}]}', "shot 1 of run.json has no whole frame numbers"),
        ('{"shots": [{}, {"start": "x"}]}', "has no whole frame numbers"),
        ('{"shots": [{}, {"start": 1e999}]}', "has no whole frame numbers"),
        ('{"shots": [{}, {"transition": 5}]}', "has no whole frame numbers"),
        ('{"shots": [{}, {"start": 5}]}', "the transitions .5, 5. disagree with the cuts 6"),
    ],
)
def test_what_is_wrong_with_the_shots_of_a_run_folder_is_told(
    tmp_path: Path, recording: Recording, text: str, sentence: str
) -> None:
    write_motion(tmp_path / "run" / "motion.zarr", recording)
    (tmp_path / "run" / "run.json").write_text(text)
    with pytest.raises(TruthError, match=sentence):
        read_sequence(tmp_path / "run")


def test_boxes_are_those_of_people_and_passers_by_and_unknown_where_nobody_set_one(tmp_path: Path) -> None:
    box = np.array([[1.0, 2, 3, 4]])
    arrays = {"people/00/frame": np.array([1]), "people/00/bbox": box}
    arrays |= {"passers_by/00/frame": np.array([2]), "passers_by/00/bbox": 2 * box}
    np.savez(tmp_path / "a_gt.npz", **arrays)  # type: ignore[arg-type]
    found = read_boxes(tmp_path / "a_gt.npz", 3)
    assert found is not None and set(found) == {"people/00", "passers_by/00"}
    np.testing.assert_array_equal(found["people/00"], [[np.nan] * 4, box[0], [np.nan] * 4])
    np.savez(tmp_path / "b_gt.npz", joints=np.zeros(3))
    assert read_boxes(tmp_path / "b_gt.npz", 3) is None


def test_the_smallest_truth_of_the_docs_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = (Path(__file__).parents[3] / "docs" / "metrics.md").read_text(encoding="utf-8")
    (script,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    exec(script, {})
    smallest = read_sequence(tmp_path / "truth.npz")
    assert (smallest.num_frames, smallest.fps, smallest.cut_frames, smallest.cameras) == (120, 30.0, (60,), None)
    report = evaluate(smallest, smallest)
    assert (report.coverage, report.cut_f1) == (1.0, 1.0)
    assert report.wa_mpjpe100_mm == pytest.approx(0.0, abs=1e-6)
