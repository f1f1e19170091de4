"""Rows of other systems: found by the video's name, kept, a missing one is their failure."""

from pathlib import Path

import numpy as np
import pytest

from humanmm.config import Config
from humanmm.errors import InputError
from humanmm.flows.bench import imported as imported_benchmark
from humanmm.flows.bench.imported import System, parse_system, with_imported
from humanmm.flows.bench.motion import Job
from humanmm.flows.bench.planned import aist_set
from humanmm.models.benchmark.scores import MethodFigures, VideoFigures
from humanmm.storage.store.store import Store

SAMPLE = Path(__file__).parents[3] / "examples" / "aist"


def _write_truth_as_result(job: Job, path: Path, store: Store) -> None:
    """A result that is the truth, turned and moved as a whole: no figure may feel that."""
    truth = job.make(Config(), store).truth
    joints = truth.people[0].joints @ np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]).T + [3.0, 2.0, 0.0]
    np.savez(
        path,
        **{"people/00/joints": joints},
        num_frames=truth.num_frames,
        fps=truth.fps,
        cut_frames=np.array(truth.cut_frames),
        joint_names=np.array(truth.joint_names),
    )


def test_a_perfect_result_has_no_error_and_a_missing_one_is_a_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    jobs, _ = aist_set(SAMPLE, "tiny")
    store = Store(tmp_path / "store")
    (tmp_path / "theirs").mkdir()
    _write_truth_as_result(jobs[0], tmp_path / "theirs" / f"{jobs[0].name}.npz", store)
    ours = MethodFigures("humanmm", (), ())
    done = [VideoFigures(job.name, job.split, (ours,)) for job in jobs]
    systems = [System("Theirs", tmp_path / "theirs")]
    found, missing = with_imported(jobs, done, systems, Config(), store)
    assert [one.method for one in found.methods] == ["humanmm", "Theirs"]
    figures = {figure.name: figure.value for figure in found.methods[1].figures}
    for name in ("pa_mpjpe_mm", "wa_mpjpe100_mm", "rte_m", "roe_deg"):
        assert figures[name] == pytest.approx(0, abs=1e-3), name
    assert "holds no single result" in missing.methods[1].failure

    def never(*arguments: object, **named: object) -> None:
        raise AssertionError("read again")

    monkeypatch.setattr(imported_benchmark, "read_result", never)
    again, _ = with_imported(jobs, done, systems, Config(), store)
    assert again == found


@pytest.mark.parametrize(
    "text", ["GVHMR", "=folder", "GVHMR=", "humanmm={folder}", "concat={folder}", "GVHMR=no/folder"]
)
def test_a_name_without_a_folder_or_one_of_ours_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(InputError, match="--imported"):
        parse_system(text.format(folder=tmp_path))
    assert parse_system(f"GVHMR={tmp_path}") == System("GVHMR", tmp_path)
