"""FBX through Blender: what is said where there is none. test_blender.py opens the file."""

from pathlib import Path

import pytest
import two_people

from humanmm.errors import InputError
from humanmm.storage.run_folder.exporters import export

RECORDING = two_people.recording()


def test_without_blender_a_sentence_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("HUMANMM_BLENDER", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(InputError, match="there is no `blender` on the path; install Blender"):
        export(RECORDING, tmp_path / "out", "fbx")
    monkeypatch.setenv("HUMANMM_BLENDER", str(tmp_path / "nothing"))
    with pytest.raises(InputError, match="which is no program"):
        export(RECORDING, tmp_path / "out", "fbx")


def test_a_blender_that_fails_is_reported_with_its_last_word(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = tmp_path / "blender"
    program.write_text("#!/bin/sh\necho one >&2\necho 'no module fbx' >&2\nexit 3\n")
    program.chmod(0o755)
    monkeypatch.setenv("HUMANMM_BLENDER", str(program))
    with pytest.raises(InputError, match="could not write the fbx: no module fbx"):
        export(RECORDING, tmp_path / "new" / "out", "fbx")
    assert not (tmp_path / "new").exists()
    (tmp_path / "out").mkdir()
    with pytest.raises(InputError, match="could not write the fbx"):
        export(RECORDING, tmp_path / "out", "fbx")
    assert not list((tmp_path / "out").iterdir()), "a folder that was there stays, as empty as it was"
