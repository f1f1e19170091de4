"""The examples of docs/api.md below `The stages by themselves` chain all stages on a short real clip with a cut."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from short_clip import write_short_clip

ROOT = Path(__file__).resolve().parent.parent
HEADING = "## The stages by themselves"


def test_the_stages_chain_without_store_or_server(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_short_clip(tmp_path / "film.mp4", frames=(26, 46), max_side_px=640, step=2)  # the cut at 36 is in the middle
    monkeypatch.chdir(tmp_path)
    page = (ROOT / "docs" / "api.md").read_text()
    text = page[page.index(HEADING) :]
    names: dict[str, Any] = {}
    for block in re.finditer(r"```python\n(.*?)```", text, re.S):
        line = page[: page.index(HEADING) + block.start()].count("\n") + 1
        exec(compile("\n" * line + block[1], "docs/api.md", "exec"), names)
    assert [(shot.start, shot.end) for shot in names["shots"].shots] == [(0, 5), (5, 10)]
    recording = names["recording"]
    person = recording.people[0]
    assert person.joints.shape == (10, 24, 3) and np.isfinite(person.joints).all()
    assert names["world"].cuts[0].linked
    results, seen = names["results"], names["key_frames"]
    given = {"key_frames": results.key_frames, "ground": results.ground, "pictures": results.pictures}
    assert given == {"key_frames": seen.of_shot, "ground": seen.ground, "pictures": seen.pictures}, "as tasks/align.py"
    assert all(results.pictures)
    assert list(tmp_path.iterdir()) == [tmp_path / "film.mp4"], "nothing is written"
