"""Parts are found by name, ours and those of other packages; what is chosen is part of the key."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from short_clip import write_short_clip

from humanmm import parts
from humanmm.config import Config
from humanmm.config_reading import validate
from humanmm.errors import ConfigError
from humanmm.flows.bench.motion import recipes_of
from humanmm.flows.bench.planned import aist_set
from humanmm.models.records.tracks import ScenePeople
from humanmm.storage.store.identity import identify
from humanmm.storage.store.open import open_store
from humanmm.tasks import pipeline
from humanmm.tasks.engine.run import VideoRun
from humanmm.tasks.units.digest import code_digest

PLUGIN = Path(__file__).resolve().parent.parent / "examples" / "pose_network_plugin"
MIRRORED = {"people": {"pose": "mirrored"}}


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example package as pip installs it."""
    source, site = tmp_path_factory.mktemp("plugin") / "source", tmp_path_factory.mktemp("site")
    shutil.copytree(PLUGIN, source)
    flags = ["--quiet", "--no-deps", "--no-build-isolation", "--no-index", "--target", os.fspath(site)]
    subprocess.run([sys.executable, "-m", "pip", "install", *flags, os.fspath(source)], check=True)
    return site


@pytest.fixture
def site(installed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of it in a folder that Python looks into."""
    folder = tmp_path / "site"
    shutil.copytree(installed, folder)
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.delitem(sys.modules, "mirrored_pose", raising=False)
    return folder


@pytest.mark.parametrize("setting", list(parts.BUILT_IN))
def test_every_part_of_ours_can_be_loaded_and_is_the_default_or_an_alternative(setting: str) -> None:
    section, _, field = setting.partition(".")
    assert getattr(getattr(Config(), section), field) in parts.BUILT_IN[setting]
    for name in parts.BUILT_IN[setting]:
        assert callable(parts.load(setting, name))


def test_an_unknown_name_is_refused_in_one_sentence_with_those_that_there_are() -> None:
    with pytest.raises(ConfigError) as refused:
        validate(MIRRORED)
    assert str(refused.value) == (
        "people.pose has no part called 'mirrored'; "
        "installed are: best, blazepose-full, blazepose-heavy, fast (docs/extend.md adds others)"
    )


def test_the_registry_loads_no_science() -> None:
    script = (
        "import sys\nfrom humanmm import parts\nfrom humanmm.config import Config\n"
        "Config(align={'method': 'eight-point'})\nparts.every()\n"
        "sys.exit(bool({'cv2', 'torch', 'scipy', 'numpy', 'prefect'} & set(sys.modules)))\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True)


def test_the_chosen_method_is_part_of_the_key() -> None:
    stage = next(stage for stage in pipeline.STAGES if stage.name == "align")
    chosen = parts.chosen(Config(), stage.settings)
    assert [(part.setting, part.name) for part in chosen] == [("align.method", "bundle")]
    assert "humanmm.models.cuts.camera_rotation" in code_digest(stage.function[0], chosen).modules


def test_the_lifter_is_part_of_the_key_where_there_are_2d_keypoints_alone() -> None:
    sample = PLUGIN.parent / "aist"
    (of_keypoints, *_), _ = aist_set(sample, "tiny")
    recipe = recipes_of(of_keypoints, Config(), ("humanmm",)).motions
    assert recipe.settings["lifting"] == {"method": "transformer", "weights": None, "keypoints": "transformer"}
    assert (
        "humanmm.models.perception.lifting.keypoints" in recipe.modules
        and "keypoint_lifter.safetensors" in recipe.weights
    )
    assert "humanmm.models.camera.estimate" in recipe.modules, "named by camera.estimator alone"
    assert [stage.name for stage in pipeline.STAGES if "lifting" in stage.settings] == ["people"], "keypoints_from"


def test_a_pose_network_of_another_package_recovers_people_and_its_version_changes_the_key(
    site: Path, tmp_path: Path
) -> None:
    write_short_clip(tmp_path / "film.mp4", frames=(20, 23), max_side_px=640)
    store = open_store(tmp_path / "store")

    def opened(**settings: object) -> VideoRun:
        run = VideoRun(identify(tmp_path / "film.mp4", store), Config.model_validate(settings), store)
        for stage in ("decode", "scenes"):
            run.execute(run.unit(stage))
        return run

    ours, theirs = opened(), opened(**MIRRORED)
    people, points = theirs.unit("people"), theirs.unit("points")
    theirs.execute(people)
    track = theirs.read(people, ScenePeople).tracks[0]
    assert len(track.frame) == 3 and "mirrored_pose" in sys.modules
    recipe = theirs.keys.recipe(people)
    assert recipe.libraries["humanmm-mirrored-pose"] == "1.0" and "mirrored_pose" in recipe.modules
    assert recipe.key != ours.keys.recipe(people).key
    assert theirs.keys.recipe(points).key == ours.keys.recipe(points).key, "other stages keep their keys"

    metadata = site / "humanmm_mirrored_pose-1.0.dist-info" / "METADATA"
    metadata.write_text(metadata.read_text().replace("Version: 1.0", "Version: 1.1"))
    later = opened(**MIRRORED).keys.recipe(people)
    assert later.changes_since(recipe) == ["version changed: humanmm-mirrored-pose 1.0 → 1.1"]


def test_code_and_weights_of_another_package_change_the_key(site: Path) -> None:
    before = code_digest("humanmm.tasks.people", [parts.find("people.pose", "mirrored")])
    module = site / "mirrored_pose.py"
    module.write_text(module.read_text().replace(") / 2", ") * 0.5") + '\nWEIGHTS = "net.onnx"\n')
    (site / "net.onnx").write_bytes(b"one")
    after = code_digest("humanmm.tasks.people", [parts.find("people.pose", "mirrored")])
    assert [name for name in after.modules if after.modules[name] != before.modules[name]] == ["mirrored_pose"]
    assert "net.onnx" in after.weights and "net.onnx" not in before.weights
