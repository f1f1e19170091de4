"""Rendered clips as files: the same bytes every time, and a truth that the evaluation reads."""

import shutil
from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pytest

from humanmm.errors import InputError
from humanmm.flows.bench.render_set import SetPlan, build_set
from humanmm.models.evaluation.evaluate import evaluate
from humanmm.storage.readers.archives import NpzArrays
from humanmm.storage.readers.truth import read_sequence

PACK = Path(__file__).parents[3] / "data" / "mocap" / "cmu_val.npz"
PLAN = SetPlan((PACK,), "tiny", seed=5, seconds=(0.15, 0.15), resolution=(160, 90))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_set(PLAN, tmp_path_factory.mktemp("set"))


def test_the_same_set_is_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    again = build_set(PLAN, tmp_path / "again")
    names = sorted(path.name for path in folder.iterdir())
    assert names == sorted(path.name for path in again.iterdir())
    assert [(folder / name).read_bytes() for name in names] == [(again / name).read_bytes() for name in names]


def test_a_truth_compared_with_itself_has_no_error(folder: Path) -> None:
    (path,) = folder.glob("*_gt.npz")
    sequence = read_sequence(path)
    figures = evaluate(sequence, sequence).to_json()
    assert figures["coverage"] == 1.0
    assert figures["mpjpe_mm"] == pytest.approx(0.0, abs=1e-6)


def test_video_truth_and_masks_have_the_same_frames(folder: Path) -> None:
    (truth,), (video,), (masks,) = (list(folder.glob(kind)) for kind in ("*_gt.npz", "*.mp4", "*_masks.npz"))
    arrays = NpzArrays(truth)
    with av.open(str(video)) as container:
        frames = [frame for frame in container.decode(video=0)]
    assert len(frames) == int(arrays["num_frames"]) == len(NpzArrays(masks)["people/00/mask"])
    assert (frames[0].width, frames[0].height) == (160, 90)
    assert float(frames[-1].time) == pytest.approx(arrays["time_s"][-1], abs=1e-4)


def test_boxes_are_those_of_the_masks(folder: Path) -> None:
    (truth,), (masks,) = (list(folder.glob(kind)) for kind in ("*_gt.npz", "*_masks.npz"))
    mask = np.unpackbits(NpzArrays(masks)["people/00/mask"][3], axis=-1)[:, :160]
    rows, columns = np.nonzero(mask)
    box = NpzArrays(truth)["people/00/bbox"][3]
    assert box.tolist() == [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]


def test_a_folder_with_another_set_is_left_alone(folder: Path) -> None:
    with pytest.raises(InputError, match="another set"):
        build_set(SetPlan((PACK,), "tiny", seed=6), folder)


def test_a_set_that_takes_the_place_of_another_leaves_none_of_its_clips(folder: Path, tmp_path: Path) -> None:
    other = tmp_path / "set"
    shutil.copytree(folder, other)
    (other / "notes.mp4").write_bytes(b"the user's own")
    build_set(replace(PLAN, seed=6), other, force=True)
    names = {path.name for path in other.iterdir()}
    assert "notes.mp4" in names
    assert not names & {path.name for path in folder.glob("*.[mn]p[4z]")}
    assert len(list(other.glob("*_gt.npz"))) == len(list(other.glob("*_masks.npz"))) == 1
