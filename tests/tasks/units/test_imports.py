"""Code is imported before its stage's turn, and what cannot be imported fails then, not before."""

import sys
from pathlib import Path

import pytest

from humanmm.tasks.pipeline import Stage
from humanmm.tasks.units.imports import Imports


def _stages(folder: Path, monkeypatch: pytest.MonkeyPatch, **bodies: str) -> list[Stage]:
    monkeypatch.syspath_prepend(str(folder))
    for name, body in bodies.items():
        (folder / f"stage_{name}.py").write_text(body)
        monkeypatch.delitem(sys.modules, f"stage_{name}", raising=False)
    return [Stage(name, "video", (), (), "builtins:int", module=f"stage_{name}") for name in bodies]


def test_what_is_to_come_is_imported_at_once_and_what_is_over_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bodies = {name: f"def {name}(inputs): return 1\n" for name in ("first", "second", "third", "fourth")}
    stages = _stages(tmp_path, monkeypatch, **bodies)
    Imports(stages).prepare(stages[1])
    assert [name for name in bodies if f"stage_{name}" in sys.modules] == ["second", "third", "fourth"]


def test_a_broken_stage_says_so_when_it_is_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stages = _stages(tmp_path, monkeypatch, sound="def sound(inputs): return 1\n", broken="import no_such_module\n")
    imports = Imports(stages)
    imports.prepare(stages[0])
    assert imports.function(stages[0])(None) == 1
    with pytest.raises(ModuleNotFoundError, match="no_such_module"):
        imports.function(stages[1])
