"""Which changes of code make a stage run again."""

import os
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from humanmm.tasks.units.digest import CodeDigest, code_digest


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package in which `stage` imports `science`, which imports `deep.constants` inside a function."""
    root = tmp_path / "snippet"
    (root / "deep").mkdir(parents=True)
    for name in ("__init__.py", "deep/__init__.py"):
        (root / name).write_text("")
    (root / "stage.py").write_text("import cv2\nfrom humanmm.errors import StageError\nfrom snippet import science\n")
    (root / "science.py").write_text(
        '"""Docstring."""\nimport numpy\n\n\ndef f(x):\n    """Says."""\n'
        "    from .deep.constants import K\n    return K * x\n"
    )
    (root / "deep" / "constants.py").write_text("K = 1\n")
    (root / "unrelated.py").write_text("K = 1\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    return root


def _digest(package: Path) -> CodeDigest:
    return code_digest("snippet.stage", weights_dir=package / "deep")


def test_imports_are_followed_without_importing_anything(package: Path) -> None:
    digest = _digest(package)
    assert set(digest.modules) == {
        "snippet.stage", "snippet.science", "snippet.deep", "snippet.deep.constants",
    }  # fmt: skip
    assert {"cv2", "numpy", "python"} == set(digest.libraries)


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        ("science.py", "K * x", "K + x"),
        ("deep/constants.py", "K = 1", "K = 2"),
        ("stage.py", "import cv2", "import cv2\nimport numpy"),
    ],
)
def test_changed_code_changes_the_digest_of_its_module_alone(package: Path, file: str, old: str, new: str) -> None:
    before = _digest(package).modules
    (package / file).write_text((package / file).read_text().replace(old, new))
    after = _digest(package).modules
    changed = [name for name in before if before[name] != after[name]]
    assert changed == ["snippet." + file.removesuffix(".py").replace("/", ".")]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"""Says."""', '"""Says something else, at length."""'),
        ('"""Docstring."""\n', "# a comment instead\n\n\n"),
        ("    return", "    # why\n    return"),
        ("K * x", "(K * x)"),
    ],
)
def test_reworded_texts_and_layout_change_nothing(package: Path, old: str, new: str) -> None:
    before = _digest(package)
    path = package / "science.py"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    assert _digest(package) == before


def test_code_that_is_not_imported_does_not_count(package: Path) -> None:
    before = _digest(package)
    (package / "unrelated.py").write_text("K = 2\n")
    assert _digest(package) == before


def test_a_weight_file_counts_when_its_name_is_in_the_code(package: Path) -> None:
    (package / "deep" / "net.tflite").write_bytes(b"weights")
    (package / "deep" / "other.tflite").write_bytes(b"weights")
    assert _digest(package).weights == {}
    (package / "science.py").write_text('NET = "net.tflite"\n')
    before = _digest(package).weights
    assert list(before) == ["net.tflite"]
    (package / "deep" / "net.tflite").write_bytes(b"Weights")
    assert _digest(package).weights != before


def test_every_real_stage_has_a_digest_that_leaves_out_what_is_no_science() -> None:
    stages = import_module("humanmm.tasks.pipeline").STAGES
    people = code_digest("humanmm.tasks.people")
    assert {"movenet-multipose.tflite", "movenet-thunder.tflite", "pose_landmark_heavy.tflite"} <= set(people.weights)
    for stage in stages:
        names = code_digest(stage.function[0]).modules
        assert stage.function[0] in names
        left_out = ("humanmm.config", "humanmm.errors", "humanmm.storage.store.store", "humanmm.tasks.engine.run")
        assert not [name for name in names if name.startswith(left_out)]


@pytest.mark.parametrize(
    ("stage", "modules"),
    [
        ("people", {"bodies", "keypoints", "regions"}),
        ("intrinsics", {"cameras", "colmap"}),
    ],
)
def test_the_readers_of_what_is_given_count(stage: str, modules: set[str]) -> None:
    names = set(code_digest(f"humanmm.tasks.{stage}").modules)
    assert {f"humanmm.storage.readers.given.{name}" for name in modules} <= names


def test_whatever_reaches_for_files_of_others_counts() -> None:
    names = set(code_digest("humanmm.tasks.people").modules)
    assert {"humanmm.storage.readers.archives", "humanmm.storage.readers.restricted_pickle"} <= names


def test_what_writes_pictures_and_videos_counts() -> None:
    names = set(code_digest("humanmm.tasks.deliver").modules)
    assert {"humanmm.storage.run_folder.picture_files", "humanmm.storage.view.embedded_video"} <= names


def test_another_checkout_has_the_same_digests(tmp_path: Path) -> None:
    root = Path(__file__).resolve().parents[3]
    for name in ("src", "flows", "tasks", "models", "storage"):
        ignored = shutil.ignore_patterns("__pycache__", "*.egg-info")
        shutil.copytree(root / name, tmp_path / "elsewhere" / name, symlinks=True, ignore=ignored)
    script = (
        "from humanmm.tasks.units.digest import code_digest\n"
        "from humanmm.tasks.pipeline import STAGES\n"
        "print([repr(code_digest(stage.function[0])) for stage in STAGES])\n"
    )
    message = [
        subprocess.run(
            [sys.executable, "-c", script], env={**os.environ, "PYTHONPATH": str(place / "src")}, check=True,
            capture_output=True, text=True,
        ).stdout
        for place in (root, tmp_path / "elsewhere")
    ]  # fmt: skip
    assert message[0] == message[1] and ".tflite" in message[0]
