"""Settings on the command line: flags of every field, with what they take, win over a file."""

from pathlib import Path
from typing import Any, Literal

import pytest
from pydantic import BaseModel, Field

from humanmm.cli.settings import Settings, Values
from humanmm.config import Config, PeopleConfig
from humanmm.errors import UsageError


class Section(BaseModel):
    """Fields of all kinds."""

    number: int = Field(3, ge=1, le=9)
    ratio: float | None = Field(None, gt=0)
    switch: bool = True
    choice: Literal["near", "far"] = "near"
    long: Literal["first choice", "second choice", "third choice"] = "first choice"
    name: str | None = None


@pytest.mark.parametrize(
    ("field", "expected"),
    [
        ("number", Values("INT", note=" (≥ 1, ≤ 9)")),
        ("ratio", Values("FLOAT", note=" (> 0)")),
        ("switch", Values("true|false", ("true", "false"))),
        ("choice", Values("near|far", ("near", "far"))),
        ("name", Values("TEXT")),
    ],
)
def test_help_says_what_a_field_takes(field: str, expected: Values) -> None:
    assert Values.of(f"section.{field}", Section.model_fields[field]) == expected


def test_many_choices_stand_behind_the_help_and_are_completed() -> None:
    values = Values.of("section.long", Section.model_fields["long"])
    assert values.metavar == "NAME" and values.note == " (first choice, second choice, third choice)"
    assert values.complete("s") == ["second choice"] and values.complete("x") == []
    assert "blazepose-heavy" in Values.of("people.pose", PeopleConfig.model_fields["pose"]).choices


def test_every_field_has_a_flag_but_corrections_have_their_own_file() -> None:
    names = {parameter.name for parameter in Settings.declared()}
    fields = {
        f"{section}__{name}"
        for section, info in Config.model_fields.items() if section != "corrections"
        for name in info.annotation.model_fields  # type: ignore[union-attr]
    }  # fmt: skip
    assert names == fields | {"config"}


def test_flags_win_over_the_file_and_shorthands_over_flags(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("[camera]\nstatic = true\n[run]\nthreads = 3\nmax_retries = 1\n")
    given: dict[str, Any] = {"config": file, "run__threads": "5", "run__max_retries": None}
    settings = Settings.given(given)
    config = settings.config()
    assert (config.camera.static, config.run.threads, config.run.max_retries) == (True, 5, 1)
    assert settings.config(**{"run.threads": 2}).run.threads == 2
    assert settings.words() == ["--config", "mine.toml", "--run.threads", "5"]
    with pytest.raises(UsageError, match="threads"):
        Settings(None, {"run.threads": "many"}).config()


def test_none_clears_what_need_not_be_given_and_is_a_name_elsewhere(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("[intrinsics]\nfocal_px = 900.0\n[run]\nlimit_s = 5\n")
    flags = {"intrinsics.focal_px": "None", "run.limit_s": "none", "lifting.method": "none", "refine.networks": "none"}
    config = Settings(file, flags).config()
    assert (config.intrinsics.focal_px, config.run.limit_s) == (None, None)
    assert (config.lifting.method, config.refine.networks) == ("none", "none"), "as docs/method.md has it"
    with pytest.raises(UsageError, match=r"align\.method has no part called 'none'"):
        Settings(None, {"align.method": "none"}).config()
