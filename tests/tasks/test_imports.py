"""Code is imported before its stage's turn, and what cannot be imported fails then, not before."""

import sys
import threading
from pathlib import Path

import pytest

from humanmm.tasks.imports import Imports
from humanmm.tasks.pipeline import Stage


def _stages(folder: Path, monkeypatch: pytest.MonkeyPatch, **bodies: str) -> list[Stage]:
    monkeypatch.syspath_prepend(str(folder))
    for name, body in bodies.items():
        (folder / f"stage_{name}.py").write_text(body)
        monkeypatch.delitem(sys.modules, f"stage_{name}", raising=False)
    return [Stage(name, "video", (), (), "builtins:int", module=f"stage_{name}") for name in bodies]


def test_later_stages_are_imported_in_a_thread_and_earlier_ones_are_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    body = "import threading\nTHREAD = threading.current_thread().name\ndef {0}(inputs): return 1\n"
    bodies = {name: body.format(name) for name in ("first", "second", "third", "fourth")}
    stages = _stages(tmp_path, monkeypatch, **bodies)
    imports = Imports(stages)
    assert imports.function(stages[1])(None) == 1
    imports.begin(after=stages[1])
    imports.begin(after=stages[0])  # it has begun already
    while "stage_fourth" not in sys.modules:
        threading.Event().wait(0.01)
    imports.end()
    assert sys.modules["stage_third"].THREAD == sys.modules["stage_fourth"].THREAD == "imports"
    assert "stage_first" not in sys.modules


def test_a_broken_stage_says_so_when_it_is_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stages = _stages(tmp_path, monkeypatch, sound="def sound(inputs): return 1\n", broken="import no_such_module\n")
    imports = Imports(stages)
    imports.begin(after=stages[0])
    imports.end()
    with pytest.raises(ModuleNotFoundError, match="no_such_module"):
        imports.function(stages[1])
