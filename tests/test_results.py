"""A run folder as a Python value, and how a notebook shows it."""

import errno
import json
import os
from pathlib import Path
from typing import Any

import pytest

import humanmm
from humanmm.errors import InputError, StoreError, TruthError
from humanmm.storage.run_folder.run_record import SCHEMA


def _folder(folder: Path, **record: Any) -> Path:
    folder.mkdir()
    tree = {
        "schema": SCHEMA, "state": "done", "video": {"path": "/f.mp4", "num_frames": 3}, "people": [], "shots": [],
        "stages": [], "warnings": [], **record,
    }  # fmt: skip
    (folder / "run.json").write_text(json.dumps(tree))
    return folder


def test_a_folder_that_holds_no_run_is_reported(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is no run folder"):
        humanmm.load(tmp_path)
    with pytest.raises(InputError, match="is no run folder"):
        humanmm.load(str(tmp_path / "missing"))


def test_a_notebook_shows_the_facts_the_warnings_and_the_view_from_above(tmp_path: Path) -> None:
    run = humanmm.load(_folder(tmp_path / "run", warnings=[f"warning {k}" for k in range(9)]))
    assert run._repr_png_() is None and "<img" not in run._repr_html_()
    (run.folder / "view").mkdir()
    (run.folder / "view" / "top.png").write_bytes(b"\x89PNG")
    page = run._repr_html_()
    assert run._repr_png_() == b"\x89PNG" and 'src="data:image/png;base64,iVBORw=="' in page
    assert "done: 3 frames" in page and "warning 4" in page and "warning 5" not in page and "and 4 more" in page


def test_nothing_that_a_run_says_becomes_markup(tmp_path: Path) -> None:
    failed = {"stage": "camera", "unit": "shot 0", "state": "failed", "reason": "<img src=x onerror=alert(1)>"}
    run = humanmm.load(_folder(tmp_path / "<b>&", warnings=["<script>alert(1)</script>"], stages=[failed]))
    page = run._repr_html_()
    assert "<script" not in page and "<img src=x" not in page and "<b>&<" not in page
    assert "&lt;script&gt;" in page and "&lt;b&gt;&amp;" in page


def test_a_run_folder_that_is_gone_is_shown_as_a_sentence(tmp_path: Path) -> None:
    assert "is no run folder" in humanmm.Run(tmp_path / "gone")._repr_html_()


def test_a_run_is_evaluated_against_itself_by_value_or_by_path(toy: Any) -> None:
    toy.run()
    assert toy.main("recover", "film.mp4")[0] == 0
    folder = toy.folder / "runs" / "film"
    run = humanmm.load(folder)
    assert humanmm.evaluate(run, str(folder)) == humanmm.evaluate(folder, run)
    assert humanmm.evaluate(run, run).cut_f1 == 1.0
    with pytest.raises(TruthError, match=r"film\.mp4"):
        humanmm.evaluate(run, toy.video)


def test_a_users_exports_are_no_part_of_the_run(toy: Any) -> None:
    toy.run()
    assert toy.main("recover", "film.mp4")[0] == 0
    run = humanmm.load(toy.folder / "runs" / "film")
    written = run.export("tum", person=0)
    (run.folder / "motion.zarr" / "time_s" / "zarr.json").unlink()
    assert toy.main("recover", "film.mp4")[2].endswith("nothing had to be computed\n"), "the motion is restored"
    assert all(path.is_file() for path in written), "they are exports of the same motion"
    for path in (*written, run.folder / "export" / "exports.json"):
        path.unlink()
    assert toy.main("recover", "film.mp4")[2].endswith("were in the store\n"), "nothing of the run is missing"


def test_a_run_folder_that_may_only_be_read_says_to_name_another_folder(
    toy: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    toy.run()
    assert toy.main("recover", "film.mp4")[0] == 0
    run = humanmm.load(toy.folder / "runs" / "film")

    def refuse(*given: object) -> int:
        raise PermissionError(errno.EACCES, "Permission denied")

    with monkeypatch.context() as patched:
        patched.setattr(os, "open", refuse)
        with pytest.raises(StoreError, match=r"\.lock: permission denied; name another folder with --out"):
            run.export("csv")


def test_files_of_a_run_are_refused_and_replaced(toy: Any) -> None:
    toy.run()
    assert toy.main("recover", "film.mp4")[0] == 0
    run = humanmm.load(toy.folder / "runs" / "film")
    (path,) = run.export("csv")
    assert path == run.folder / "export" / "person_00.csv" and path.is_file()
    with pytest.raises(InputError, match="exists already"):
        run.export("csv")
    assert run.export("csv", force=True) == (path,)
    with pytest.raises(InputError, match="no format 'blend'"):
        run.export("blend")
    assert run._repr_png_() is None, "the toy draws none"
    assert {path.name for path in run.draw()} == {"overlay.mp4", "top.png", "timeline.png"}
    assert run._repr_png_() is not None
