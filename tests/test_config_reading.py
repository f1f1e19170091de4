"""Settings from what people write."""

from pathlib import Path

import pytest

from humanmm.config import Config
from humanmm.config_reading import resolve, with_sections, with_values
from humanmm.errors import ConfigError


def test_single_values_replace_those_of_a_tree() -> None:
    assert with_values({"shots": {"person": 1, "min_confidence": 0.3}}, {"shots.person": 0, "hmr.method": "fit"}) == {
        "shots": {"person": 0, "min_confidence": 0.3}, "hmr": {"method": "fit"},
    }  # fmt: skip
    assert with_sections({"shots": {"person": 1}}, {"shots": {}, "new": 3}) == {"shots": {"person": 1}, "new": 3}
    assert resolve(None, {"person": 0}).shots.person == 0
    assert resolve(Config(), {"person": 0}).shots.person == 0


@pytest.mark.parametrize("tree", [{"shots": 5}, {"shots": None}, {"shots": [1]}])
def test_a_section_that_is_none_is_refused_in_one_sentence(tree: dict[str, object]) -> None:
    for values in ({}, {"person": 0}):
        with pytest.raises(ConfigError, match="setting shots: "):
            resolve(tree, values)


@pytest.mark.parametrize("setting", ["deliver.scene_max_s", "run.limit_s"])
@pytest.mark.parametrize("value", ["inf", float("inf"), "nan"])
def test_a_number_that_is_not_finite_is_refused_before_anything_is_computed(setting: str, value: object) -> None:
    with pytest.raises(ConfigError, match=f"setting {setting}: input should be a finite number, not "):
        resolve(None, {setting: value})


def test_a_file_of_settings_may_begin_with_a_byte_order_mark(tmp_path: Path) -> None:
    path = tmp_path / "settings.toml"
    path.write_text("\ufeff[camera]\nstatic = true\n", encoding="utf-8")
    assert resolve(path).camera.static


def test_two_focal_lengths_exclude_each_other_wherever_they_come_from() -> None:
    for config in (None, {"intrinsics": {"focal_px": 1000}}):
        with pytest.raises(ConfigError, match="focal_px and fov_deg exclude each other"):
            resolve(config, {"focal_px": 1000, "fov_deg": 50} if config is None else {"fov_deg": 50})
