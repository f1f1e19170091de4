"""`bench ms-render` without --data makes its own set, and finds it again."""

import json
from pathlib import Path

import pytest
from grey_clothing import grey_clothing

from humanmm.cli import main
from humanmm.flows.bench.clips import clip_set, labels_of_jobs
from humanmm.flows.bench.render_set import SIZES, SPLITS, SetPlan, build_set, own_set, shipped_packs, takes_of
from humanmm.models.rendering import renderer
from humanmm.storage.readers.mocap_pack import read_pack
from humanmm.storage.readers.truth import read_sequence
from humanmm.storage.store.open import open_store

PACKS = shipped_packs()


@pytest.mark.usefixtures("parsed_once")
def test_the_own_set_is_made_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HUMANMM_CACHE", str(tmp_path))
    monkeypatch.setitem(SIZES, "tiny", SIZES["tiny"].__class__(1, (0.2, 0.2), (64, 36), (0, 0)))
    folder = own_set("tiny")
    (video,) = folder.glob("*.mp4")
    made = video.stat().st_mtime_ns
    assert own_set("tiny") == folder
    assert video.stat().st_mtime_ns == made


def test_a_larger_set_begins_with_the_clips_of_a_smaller_one() -> None:
    one, two = (SetPlan(PACKS, "standard", seed=1, count=count).clips() for count in (2, 5))
    assert two[:2] == one


def test_a_size_given_with_a_folder_of_clips_is_a_usage_error(tmp_path: Path) -> None:
    assert main(["bench", "ms-render", "--data", str(tmp_path), "--size", "tiny"]) == 2


def test_a_table_that_cannot_make_its_own_data_asks_for_it() -> None:
    assert main(["bench", "ms-real"]) == 2


def test_dataset_build_refuses_less_than_one_clip(tmp_path: Path) -> None:
    assert main(["dataset", "build", "ms-render", "--out", str(tmp_path / "set"), "--count", "0"]) == 2


def test_splits_of_places_share_no_subject_and_train_has_all_others() -> None:
    assert not SPLITS["dev"] & SPLITS["test"]
    for split in ("dev", "test"):
        sequences = [sequence for pack in shipped_packs("places", split) for sequence in read_pack(pack)]
        assert {take.subject for take in takes_of(sequences, split)} <= SPLITS[split]
        assert not takes_of(sequences, "train")


def test_a_clip_of_places_says_what_it_has(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(renderer, "random_clothing", grey_clothing)
    plan = SetPlan(
        shipped_packs("places", "dev"), "places", seed=4, count=1, seconds=(2.4, 2.4), resolution=(96, 54), split="dev"
    )
    folder = build_set(plan, tmp_path / "set" / "dev", threads=1)
    (video,) = folder.glob("*.mp4")
    features = json.loads((folder / "set.json").read_text(encoding="utf-8"))["clips"][video.stem]
    assert features["parts"][0]["place"] == "tiled hall"
    truth = read_sequence(folder / f"{video.stem}_gt.npz")
    assert [cut["frame"] for cut in features["cuts"]] == list(truth.cut_frames)
    assert len(truth.people) == sum(len(part["people"]) for part in features["parts"])
    jobs, _ = clip_set(tmp_path / "set", open_store(tmp_path / "store"))
    (labels,) = labels_of_jobs(jobs).values()
    assert (labels.split, labels.places[0]) == ("dev", "tiled hall")
    assert build_set(plan, folder, threads=1) == folder, "a set that is complete is found again"
