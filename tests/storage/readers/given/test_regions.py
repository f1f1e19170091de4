"""Boxes and masks in the layouts that trackers, detectors and segmenters write."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from humanmm.config import GivenFile
from humanmm.errors import InputError
from humanmm.models.perception.tracking.given_regions import GivenRegions
from humanmm.models.records.video import PictureSizes
from humanmm.storage.readers.given.regions import read_detections, read_masks

N, SIZES = 4, PictureSizes((640, 360), (640, 360))
LEFT = np.array([[20.0 + 5 * f, 30, 80, 200] for f in range(N)])  # left, top, width, height
RIGHT = np.array([[400.0, 60, 60, 180] for _ in range(N)])


def _mot(path: Path, *, ids: tuple[int, int] = (7, 3)) -> Path:
    rows = [(f + 1, who, *box[f], 0.9, 1, 1) for f in range(N) for who, box in zip(ids, (LEFT, RIGHT), strict=True)]
    path.write_text("\n".join(",".join(f"{value:g}" for value in row) for row in rows))
    return path


def _coco(path: Path, **changed: object) -> Path:
    rows = [
        {"image_id": f, "category_id": 1, "bbox": box[f].tolist(), "score": 0.9}
        for f in range(N)
        for box in (LEFT, RIGHT)
    ]
    rows[0].update(changed)
    path.write_text(json.dumps([*rows, {"image_id": 0, "category_id": 3, "bbox": [0, 0, 9, 9], "score": 1.0}]))
    return path


def _boxes(path: Path) -> GivenRegions:
    return read_detections(GivenFile.model_validate(path), N, SIZES)


def test_a_trackers_text_counts_from_one_and_keeps_its_numbers(tmp_path: Path) -> None:
    found = _boxes(_mot(tmp_path / "mot.txt"))
    assert found.frame.tolist() == [0, 0, 1, 1, 2, 2, 3, 3] and found.person.tolist() == [7, 3] * N
    np.testing.assert_allclose(found.box[::2], np.c_[LEFT[:, :2], LEFT[:, :2] + LEFT[:, 2:]])
    np.testing.assert_allclose(found.score, 0.9)


def test_a_box_without_a_number_takes_nobody_elses_away(tmp_path: Path) -> None:
    path = _mot(tmp_path / "mot.txt")
    path.write_text(path.read_text() + "\n1,-1,5,5,20,40,0.5\n1,-1,6,5,20,40,0.5")
    assert _boxes(path).person.tolist() == [7, 3, -1, -1, *([7, 3] * (N - 1))]


def test_a_detectors_json_holds_nobodys_number_and_other_things(tmp_path: Path) -> None:
    found = _boxes(_coco(tmp_path / "boxes.json"))
    assert found.frame.tolist() == [0, 0, 1, 1, 2, 2, 3, 3] and (found.person == -1).all()
    np.testing.assert_allclose(found.box[1::2], np.c_[RIGHT[:, :2], RIGHT[:, :2] + RIGHT[:, 2:]])


@pytest.mark.parametrize("write", [_mot, _coco])
def test_boxes_in_stored_pixels_become_those_of_square_ones(tmp_path: Path, write: Callable[[Path], Path]) -> None:
    given = GivenFile.model_validate(write(tmp_path / ("boxes.json" if write is _coco else "mot.txt")))
    found = read_detections(given, N, PictureSizes((960, 360), (640, 360)))
    np.testing.assert_allclose(found.box[::2], np.c_[LEFT[:, :2], LEFT[:, :2] + LEFT[:, 2:]] * [1.5, 1, 1.5, 1])


@pytest.mark.parametrize("stored", [True, False])
def test_masks_of_stored_and_of_square_pixels_give_the_same_boxes(tmp_path: Path, stored: bool) -> None:
    sizes = PictureSizes((960, 360), (640, 360))
    labels = np.zeros((360, 640) if stored else (360, 960), np.uint8)
    labels[30:230, slice(20, 100) if stored else slice(30, 150)] = 1
    (tmp_path / "masks").mkdir()
    Image.fromarray(labels).save(tmp_path / "masks/00002.png")
    found = read_masks(GivenFile.model_validate(tmp_path / "masks"), N, sizes)
    assert found.box.tolist() == [[30, 30, 150, 230]]


@pytest.mark.parametrize("palette", [False, True])
@pytest.mark.parametrize("scale", [1, 2])
def test_masks_give_boxes_and_the_pixels_of_everybody(tmp_path: Path, palette: bool, scale: int) -> None:
    folder = tmp_path / "masks"
    folder.mkdir()
    for f in range(N):
        labels = np.zeros((360, 640), np.uint8)
        for who, (x, y, w, h) in ((1, LEFT[f].astype(int)), (2, RIGHT[f].astype(int))):
            labels[y : y + h, x : x + w] = who
        picture = Image.fromarray(labels[::scale, ::scale])
        if palette:
            picture.putpalette([0, 0, 0, 200, 10, 10, 10, 200, 10])
        picture.save(folder / f"{f:05d}.png")
    found = read_masks(GivenFile.model_validate(folder), N, SIZES)
    assert found.person.tolist() == [1, 2] * N and found.labels is not None
    np.testing.assert_allclose(found.box[1::2], np.c_[RIGHT[:, :2], RIGHT[:, :2] + RIGHT[:, 2:]])
    assert set(np.unique(found.labels(2))) == {0, 1, 2} and found.labels(0).shape == (360 // scale, 640 // scale)


def test_what_is_wrong_with_boxes_is_told(tmp_path: Path) -> None:
    def told(path: Path) -> str:
        with pytest.raises(InputError) as caught:
            _boxes(path)
        assert str(tmp_path) in str(caught.value)
        return str(caught.value)

    (tmp_path / "a.txt").write_text("1,2,3\n")
    assert "a line reads '1,2,3'; expected frame, id, left" in told(tmp_path / "a.txt")
    assert "person 7 has 2 boxes in frame 0" in told(_mot(tmp_path / "b.txt", ids=(7, 7)))
    (tmp_path / "c.txt").write_text("9,1,10,10,20,20,1\n")
    assert "holds frames 8 to 8, counted from 0, the video has 4" in told(tmp_path / "c.txt")
    (tmp_path / "d.txt").write_text("1,1,0.1,0.1,0.2,0.5,1\n")
    assert "are they fractions" in told(tmp_path / "d.txt")
    assert "expected finite numbers" in told(_coco(tmp_path / "e.json", bbox=[0, 0, float("nan"), 1]))
    (tmp_path / "f.json").write_text('{"images": []}')
    assert "no list of COCO results" in told(tmp_path / "f.json")
    (tmp_path / "g.json").write_text("[]")
    assert "holds nobody" in told(tmp_path / "g.json")


def test_what_is_wrong_with_masks_is_told(tmp_path: Path) -> None:
    def told(labels: np.ndarray, name: str = "00000.png") -> str:
        folder = tmp_path / str(len(list(tmp_path.iterdir())))
        folder.mkdir()
        Image.fromarray(labels).save(folder / name)
        with pytest.raises(InputError) as caught:
            read_masks(GivenFile.model_validate(folder), N, SIZES)
        return str(caught.value)

    assert "has colours (RGB); expected one number a pixel" in told(np.zeros((360, 640, 3), np.uint8))
    assert "has 640×480 pixels, the video 640×360" in told(np.zeros((480, 640), np.uint8))
    assert "has 1280×720 pixels, the video 640×360; expected as many or fewer" in told(np.zeros((720, 1280), np.uint8))
    many = np.arange(640 * 360, dtype=np.uint32).reshape(360, 640) % 60_000
    assert "holds 59,999 people; expected at most 255" in told(many.astype(np.uint16))
    assert "every pixel is 0" in told(np.zeros((360, 640), np.uint8))
    assert "no number in the name 'last.png'" in told(np.zeros((360, 640), np.uint8), "last.png")
    assert "holds frames 9 to 9" in told(np.zeros((360, 640), np.uint8), "00009.png")
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "00000.png").write_bytes(b"no picture")
    with pytest.raises(InputError, match=r"00000\.png is no png, or it is damaged"):
        read_masks(GivenFile.model_validate(tmp_path / "x"), N, SIZES)


def test_frames_that_may_be_counted_otherwise_are_told(tmp_path: Path) -> None:
    boxes = GivenFile.model_validate(_mot(tmp_path / "mot.txt"))
    assert read_detections(boxes, N, SIZES).warnings == ()
    (early,) = read_detections(boxes, 20, SIZES).warnings
    assert "boxes end at frame 3, the video at 19" in early
    rows = [{"image_id": 1, "category_id": 1, "bbox": RIGHT[0].tolist(), "score": 0.9}]
    (tmp_path / "boxes.json").write_text(json.dumps(rows))
    (from_one,) = _boxes(tmp_path / "boxes.json").warnings
    assert "boxes begin at frame 1" in from_one
    (tmp_path / "masks").mkdir()
    Image.fromarray(np.ones((360, 640), np.uint8)).save(tmp_path / "masks/00003.png")
    (early,) = read_masks(GivenFile.model_validate(tmp_path / "masks"), 20, SIZES).warnings
    assert "masks end at frame 3" in early
