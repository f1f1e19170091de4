"""Keypoints in the layouts that other programs write, made here, come out as COCO's 17 of the same people."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from humanmm.config import GivenFile
from humanmm.errors import InputError
from humanmm.models.records.video import PictureSizes
from humanmm.storage.readers.given.keypoints import BODY_25, OPENPOSE_COCO, read_keypoints

N, SIZE = 5, (1280, 720)
SIZES = PictureSizes(SIZE, SIZE)
WIDE = PictureSizes((1920, 720), SIZE)
"""Of a video whose stored pixels are half as wide again as high."""
CLIP = Path(__file__).parents[4] / "examples/pose2sim_multishot"


def _people() -> np.ndarray:
    """(N frames, 2 people, 17, 3): standing figures that sway."""
    x = np.array([0, 1, -1, 2, -2, 8, -8, 12, -12, 14, -14, 6, -6, 7, -7, 8, -8]) * 5.0
    y = np.array([0, -1, -1, 0, 0, 8, 8, 22, 22, 34, 34, 36, 36, 56, 56, 76, 76]) * 5.0
    rng = np.random.default_rng(0)
    figure = np.stack([x, y, np.full(17, 0.9)], axis=1)
    people = figure + np.array([[300, 150, 0], [800, 170, 0]])[:, None]
    return np.asarray(
        people + np.c_[rng.normal(0, 2, (N, 2, 17, 2)).reshape(-1, 2), np.zeros(N * 34)].reshape(N, 2, 17, 3)
    )


PEOPLE = _people()


def _in_set(coco: np.ndarray, chosen: tuple[int, ...], count: int) -> np.ndarray:
    points = np.zeros((count, 3))
    points[list(chosen)] = coco
    if count == 25:
        for middle, a, b in ((1, 2, 5), (8, 9, 12)):
            points[middle] = (points[a] + points[b]) / 2
    return points


def _openpose(folder: Path, chosen: tuple[int, ...], count: int, *, first: int = 0) -> Path:
    folder.mkdir()
    for f, people in enumerate(PEOPLE):
        found = [
            {
                "person_id": [-1],
                "pose_keypoints_2d": _in_set(p, chosen, count).ravel().tolist(),
                "face_keypoints_2d": [],
            }
            for p in people
        ]
        name = f"film2_{f + first:012d}_keypoints.json"
        (folder / name).write_text(json.dumps({"version": 1.3, "people": found}))
    return folder


def _instances(people: np.ndarray) -> list[dict[str, Any]]:
    return [
        {"keypoints": p[:, :2].tolist(), "keypoint_scores": p[:, 2].tolist(), "bbox": [[0, 0, 9, 9]], "bbox_score": 1.0}
        for p in people
    ]


def _mmpose_inferencer(path: Path) -> Path:
    path.write_text(json.dumps([{"frame_id": f, "instances": _instances(p)} for f, p in enumerate(PEOPLE)]))
    return path


def _mmpose_top_down(path: Path) -> Path:
    frames = [{"frame_id": f + 1, "instances": _instances(p)} for f, p in enumerate(PEOPLE)]
    path.write_text(json.dumps({"meta_info": {"num_keypoints": 17}, "instance_info": frames}))
    return path


def _mmpose_pictures(path: Path) -> Path:
    path.mkdir()
    for f, people in enumerate(PEOPLE):
        (path / f"{f:06d}.json").write_text(json.dumps(_instances(people)))
    return path


def _alphapose(path: Path) -> Path:
    rows = [
        {
            "image_id": f"{f}.jpg",
            "category_id": 1,
            "keypoints": _in_set(p, tuple(range(17)), 26).ravel().tolist(),
            "score": 2.9,
        }
        for f, people in enumerate(PEOPLE)
        for p in people
    ]
    path.write_text(json.dumps(rows))
    return path


def _coco_annotations(path: Path) -> Path:
    images = [{"id": 100 + f, "file_name": f"frames/{f:05d}.jpg"} for f in range(N)]
    people = [
        {"image_id": 100 + f, "keypoints": np.c_[p[:, :2], np.full(17, 2)].ravel().tolist()}
        for f, people in enumerate(PEOPLE)
        for p in people
    ]
    path.write_text(json.dumps({"images": images, "annotations": people}))
    return path


WRITERS: dict[str, Callable[[Path], Path]] = {
    "OpenPose BODY_25": lambda path: _openpose(path, BODY_25, 25),
    "OpenPose BODY_25, counted from 1": lambda path: _openpose(path, BODY_25, 25, first=1),
    "OpenPose COCO": lambda path: _openpose(path, OPENPOSE_COCO, 18),
    "Sports2D Halpe 26": lambda path: _openpose(path, tuple(range(17)), 26),
    "MMPose inferencer": _mmpose_inferencer,
    "MMPose top-down": _mmpose_top_down,
    "MMPose pictures": _mmpose_pictures,
    "AlphaPose": _alphapose,
    "COCO annotations": _coco_annotations,
}


def _read(path: Path, num_frames: int = N) -> Any:
    return read_keypoints(GivenFile.model_validate(path), num_frames, SIZES)


@pytest.mark.parametrize("name", WRITERS)
def test_every_layout_gives_the_same_people_in_our_pixels(tmp_path: Path, name: str) -> None:
    found = _read(WRITERS[name](tmp_path / "given.json"))
    assert found.frame.tolist() == np.repeat(np.arange(N), 2).tolist()
    np.testing.assert_allclose(found.keypoints[..., :2], PEOPLE.reshape(-1, 17, 3)[..., :2] + 0.5, atol=1e-9)
    assert (found.keypoints[..., 2] >= 0.9).all()


@pytest.mark.parametrize("name", WRITERS)
def test_pixels_that_other_programs_see_become_square(tmp_path: Path, name: str) -> None:
    given = GivenFile.model_validate(WRITERS[name](tmp_path / "given.json"))
    found = read_keypoints(given, N, WIDE)
    expected = (PEOPLE.reshape(-1, 17, 3)[..., :2] + 0.5) * [1.5, 1.0]
    np.testing.assert_allclose(found.keypoints[..., :2], expected, atol=1e-9)


def test_a_message_says_which_pixels_are_expected(tmp_path: Path) -> None:
    small = PictureSizes((200, 100), (100, 100))
    with pytest.raises(InputError, match="100×100 as stored, in pixels that are not square"):
        read_keypoints(GivenFile.model_validate(_alphapose(tmp_path / "given.json")), N, small)


def test_real_openpose_keypoints_of_body_25b_are_known_by_where_neck_and_hips_are(tmp_path: Path) -> None:
    truth = np.load(CLIP / "pose2sim_A_01-02-01_gt.npz")
    assert truth["joint_names"][:3].tolist() == ["Nose", "LEye", "REye"]
    for f, points in enumerate(truth["openpose2d"]):
        people = [{"person_id": [-1], "pose_keypoints_2d": np.nan_to_num(points).ravel().tolist()}]
        (tmp_path / f"cam01_{f:012d}_keypoints.json").write_text(json.dumps({"version": 1.3, "people": people}))
    found = read_keypoints(GivenFile.model_validate(tmp_path), 100, PictureSizes((720, 1280), (720, 1280)))
    assert found.keypoints.shape == (100, 17, 3)
    expected = np.nan_to_num(truth["openpose2d"][:, 16]) + np.array([0.5, 0.5, 0.0])
    np.testing.assert_allclose(found.keypoints[:, 16], expected, rtol=1e-6)


def test_a_frame_without_people_counts_as_seen(tmp_path: Path) -> None:
    folder = _openpose(tmp_path / "given", BODY_25, 25)
    first = sorted(folder.iterdir())[0]
    first.write_text('{"version": 1.3, "people": []}')
    assert set(_read(folder).frame.tolist()) == {1, 2, 3, 4}


def _wrong(path: Path, content: Any, name: str = "a_000000.json") -> Path:
    path.mkdir()
    (path / name).write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def _one(points: Any) -> dict[str, Any]:
    return {"people": [{"pose_keypoints_2d": points}]}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "is not json"),
        ({"persons": []}, "laid out like no known program's"),
        (_one([1.0] * 50), "50 numbers; expected x, y and score"),
        (_one([100.0, 100.0, 0.9] * 16), "has 16 keypoints; known are the sets of 17, 18, 25, 26, 133, 136"),
        (_one([0.5, 0.5, 0.9] * 17), "fractions of the picture; expected pixels"),
        (_one([5000.0, 100.0, 0.9] * 17), "100 % of its keypoints lie outside of the video's pictures (1280×720)"),
        (_one([100.0, 100.0, 0.0] * 17), "no keypoint has a score"),
        (_one(["a", 1, 2] * 17), "expected numbers"),
        ({"people": []}, "holds nobody"),
        ([{"frame_id": 9, "instances": []}], "holds frames 9 to 9, the video has 5 (0 to 4)"),
        ([{"instances": []}], "laid out like no known program's keypoints: 'frame_id' is missing"),
        ([{"instances": [], "frame_id": "abc"}], "a frame is no number, or a table or list is something else"),
        ('[{"instances": [], "frame_id": 1e999}]', "a frame is no number"),
        ({"people": [5]}, "a table or list is something else"),
        ("[" * 200_000, "is not json, or holds lists in lists without end"),
        (_one([1e308] * 51), "keypoints holds 1e+308; expected numbers up to 1e+12"),
    ],
)
def test_what_is_wrong_is_reported_in_one_sentence_with_the_files_name(
    tmp_path: Path, content: Any, message: str
) -> None:
    with pytest.raises(InputError) as caught:
        _read(_wrong(tmp_path / "given", content))
    assert message in str(caught.value) and str(tmp_path / "given") in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_changed_after_its_content_was_noted_is_not_read(tmp_path: Path) -> None:
    given = GivenFile.model_validate(_mmpose_inferencer(tmp_path / "given.json"))
    (tmp_path / "given.json").write_text("[]")
    with pytest.raises(InputError, match="has changed since its content was noted"):
        read_keypoints(given, N, SIZES)


def test_whoever_has_no_extent_is_left_out_with_a_word(tmp_path: Path) -> None:
    path = _alphapose(tmp_path / "given.json")
    place = {"image_id": "3.jpg", "category_id": 1, "keypoints": [300.0, 300.0, 0.9] * 26, "score": 2.9}
    path.write_text(json.dumps([*json.loads(path.read_text()), place]))
    found = _read(path)
    assert len(found.frame) == 2 * N
    assert found.warnings == (
        "given keypoints of a person lie all within 2 pixels, in 1 frames from frame 3 on: he is left out there",
    )
    path.write_text(json.dumps([place]))
    with pytest.raises(InputError, match="everybody's keypoints lie within 2 pixels: they show nobody"):
        _read(path)


def test_coco_pictures_of_another_size_are_refused(tmp_path: Path) -> None:
    path = _coco_annotations(tmp_path / "given.json")
    tree = json.loads(path.read_text())
    for image in tree["images"]:
        image["width"], image["height"] = SIZE
    path.write_text(json.dumps(tree))
    assert len(_read(path).frame) == 2 * N
    tree["images"][2]["width"], tree["images"][2]["height"] = 640, 360
    path.write_text(json.dumps(tree))
    with pytest.raises(InputError, match="its pictures are 640×360 pixels, the video 1280×720; expected the same size"):
        _read(path)


def test_frames_that_may_be_counted_otherwise_are_told(tmp_path: Path) -> None:
    path = _alphapose(tmp_path / "given.json")
    rows = json.loads(path.read_text())
    assert _read(path).warnings == ()
    (early,) = _read(path, 20).warnings
    assert "keypoints end at frame 4, the video at 19: were they found in it at another frame rate?" in early
    path.write_text(json.dumps([{**row, "image_id": f"{int(row['image_id'][:-4]) + 1}.jpg"} for row in rows[:-2]]))
    (from_one,) = _read(path).warnings
    assert "keypoints begin at frame 1, and are taken as counted from 0" in from_one
