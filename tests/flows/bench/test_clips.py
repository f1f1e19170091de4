"""A folder of clips with truths: what belongs to the set, and what is told when nothing does."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from humanmm.config import Config
from humanmm.errors import HumanMMError, InputError
from humanmm.flows.bench.clips import clip_set, in_two_places
from humanmm.flows.bench.motion import Job, figures_of
from humanmm.models.benchmark.methods import METHODS
from humanmm.storage.readers.truth import read_sequence
from humanmm.storage.store.store import Store

EXAMPLE = Path(__file__).parents[3] / "examples" / "pose2sim_multishot"
NAME = "pose2sim_A_01-02-01"


def test_a_clip_is_a_video_beside_its_truth(tmp_path: Path) -> None:
    jobs, facts = clip_set(EXAMPLE, Store(tmp_path / "store"))
    assert [job.name for job in jobs] == [NAME]
    assert jobs[0].split == "2 transitions"
    assert (facts.videos, facts.transitions) == (1, (2,))


def test_a_truth_without_its_video_is_left_out_and_an_empty_folder_is_reported(tmp_path: Path) -> None:
    shutil.copy(EXAMPLE / f"{NAME}_gt.npz", tmp_path)
    with pytest.raises(InputError, match=r"no <name>\.mp4"):
        clip_set(tmp_path, Store(tmp_path / "store"))


def test_a_clip_that_cannot_be_read_is_a_failure_of_every_method_and_no_crash(tmp_path: Path) -> None:
    shutil.copy(EXAMPLE / f"{NAME}_gt.npz", tmp_path)
    (tmp_path / f"{NAME}.mp4").write_bytes(b"no video")
    store = Store(tmp_path / "store")
    try:
        jobs, _ = clip_set(tmp_path, store)
    except HumanMMError as error:
        pytest.fail(f"the set should be listed: {error}")
    (figures,) = figures_of(jobs, Config(), store)
    assert [one.method for one in figures.methods] == list(METHODS)
    assert all(one.failure for one in figures.methods)
    true_cuts = read_sequence(tmp_path / f"{NAME}_gt.npz").cut_frames
    assert true_cuts
    assert all(
        [(cut.frame, cut.error_deg) for cut in one.cuts] == [(k, None) for k in true_cuts] for one in figures.methods
    )


def test_a_rig_of_two_cameras_stands_in_two_places(tmp_path: Path) -> None:
    truth = tmp_path / "rig_gt.npz"
    shutil.copy(EXAMPLE / f"{NAME}_gt.npz", truth)
    job = Job("rig", "all", {}, {}, make=lambda config, store: pytest.fail("not made"), truth=truth)
    assert in_two_places([job, replace(job, truth=None)]) == 1
    with np.load(truth) as arrays:
        moving = {name: array for name, array in arrays.items()}
    moving["t_world2cam"] = moving["t_world2cam"] + np.linspace(0, 1, len(moving["t_world2cam"]))[:, None]
    np.savez(truth, **moving)
    assert in_two_places([job]) == 0
