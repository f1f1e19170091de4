"""Every example of docs/api.md runs, in order, on a short real clip with a cut."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from short_clip import CLIP, write_short_clip

ROOT = Path(__file__).resolve().parent.parent
TRUTH = CLIP.with_name(f"{CLIP.stem}_gt.npz")
START, END = 22, 50
"""Frames of the clip that are kept: the cut at 36 is in the middle."""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with `film.mp4` and its `truth.npz`."""
    scale = write_short_clip(tmp_path / "film.mp4", frames=(START, END), max_side_px=640)
    with np.load(TRUTH) as truth:
        arrays = {name: truth[name][START:END] if truth[name].shape[:1] == (100,) else truth[name] for name in truth}
    arrays["K"][:, :2] *= scale
    arrays["openpose2d"][..., :2] *= scale
    arrays["cut_frames"] = np.array([36 - START])
    np.savez(tmp_path / "truth.npz", **arrays)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HUMANMM_STORE", str(tmp_path / "store"))
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
    assert [(shot.start, shot.end) for shot in run.shots] == [(0, 36 - START), (36 - START, END - START)]
    x0, y0, x1, y1 = names["person"].bbox[0]
    x, y = names["joints_px"].mean(axis=0)
    assert x0 < x < x1 and y0 < y < y1, "the projected joints lie in the box"
    assert report.cut_f1 == 1.0 and report.pa_mpjpe_mm < 100
    assert names["smooth"].config.refine.cutoff_hz == 6.0
