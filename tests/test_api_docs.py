"""Every example of docs/api.md runs, in order, on a short real clip with two cuts."""

import re
import shutil
from pathlib import Path
from typing import Any

import pytest
from short_clip import FILM_CUTS, FILM_LENGTH

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture
def folder(recovered_film: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with `film.mp4` and its `truth.npz`; the store has what the film's own settings give."""
    for name in ("film.mp4", "truth.npz"):
        shutil.copy2(recovered_film / name, tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HUMANMM_STORE", str(recovered_film / "store"))
    return tmp_path


@pytest.mark.timeout(900)
@pytest.mark.usefixtures("server_cache")
def test_every_example_runs_in_order(folder: Path) -> None:
    text = (ROOT / "docs" / "api.md").read_text().partition("## The stages by themselves")[0]  # see test_stage_docs
    examples = [
        (text[: block.start()].count("\n") + 1, block[1]) for block in re.finditer(r"```python\n(.*?)```", text, re.S)
    ]
    assert len(examples) >= 6
    names: dict[str, Any] = {}
    for line, example in examples:
        code = compile("\n" * line + example, "docs/api.md", "exec")
        exec(code, names)
    run, report = names["run"], names["report"]
    assert run.folder == Path("runs/film") and (folder / "runs/film/motion.zarr").is_dir()
    first, second, end = (*FILM_CUTS, FILM_LENGTH)
    assert [(shot.start, shot.end) for shot in run.shots] == [(0, first), (first, second), (second, end)]
    x0, y0, x1, y1 = names["person"].bbox[0]
    x, y = names["joints_px"].mean(axis=0)
    assert x0 < x < x1 and y0 < y < y1, "the projected joints lie in the box"
    assert report.cut_f1 == 1.0 and report.pa_mpjpe_mm < 100
    assert names["smooth"].config.refine.cutoff_hz == 6.0
