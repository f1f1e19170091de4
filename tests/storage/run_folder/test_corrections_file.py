"""corrections.toml: one correction more or less, and everything else in it as it was."""

from pathlib import Path

import pytest

from humanmm.config import Config
from humanmm.corrections import AddCut, Floor, Main, RemoveCut, Sides, Who
from humanmm.errors import ConfigError
from humanmm.storage.run_folder.corrections_file import FILE, append, begin, corrected, decided, read_file, remove

WHO = Who(frame=31, x=411.0, y=233.46, number=2)
SIDES = Sides(who=WHO, start=30, end=40, joint="hip", left=(1.5, 2.0), right=(3.0, 4.0))


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    path = tmp_path / FILE
    written = (AddCut(frame=120), SIDES, Main(who=WHO), Floor(metres=-0.1))
    for one in written:
        append(path, one, video="ab12", remark=str(one))
    found = read_file(path)
    assert found.correction == written and found.video == "ab12" and found.origin == str(path)


def test_comments_stay_and_those_above_a_correction_go_with_it(tmp_path: Path) -> None:
    path = tmp_path / FILE
    own = '# mine\nvideo = "ab12"\n\n# first\n[[correction]]\nkind = "add-cut"  # why\nframe = 7\n'
    path.write_text(own)
    append(path, RemoveCut(frame=9), video="ab12", remark="second")
    append(path, Floor(metres=0.5), video="ab12")
    remove(path, 2)
    assert path.read_text() == own + '\n[[correction]]\nkind = "floor"\nmetres = 0.5\n'
    remove(path, 1)
    assert [one.kind for one in read_file(path).correction] == ["floor"]
    assert "# first" not in path.read_text() and path.read_text().startswith("# mine")


def test_a_file_that_cannot_be_changed_line_by_line_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / FILE
    path.write_text('correction = [{ kind = "floor", metres = 1.0 }]\n')
    before = path.read_text()
    with pytest.raises(ConfigError, match="would not be TOML any more"):
        append(path, RemoveCut(frame=9), video="")
    with pytest.raises(ConfigError, match="no number 1"):
        remove(path, 1)
    assert path.read_text() == before


def test_the_one_that_is_named_is_taken_out_however_the_tables_are_laid_out(tmp_path: Path) -> None:
    path = tmp_path / FILE
    second = '[["correction"]]\nkind = "floor"\nmetres = 0.5\n'
    path.write_text('  # why\n  [[ correction ]]\n  kind = "add-cut"\n  frame = 7\n' + second)
    with pytest.raises(ConfigError, match="not clear; take number 1 out by hand"):
        remove(path, 1)
    path.write_text(path.read_text().replace('"correction"', "correction"))
    remove(path, 1)
    assert [one.kind for one in read_file(path).correction] == ["floor"] and "why" not in path.read_text()


def test_the_name_of_a_video_may_hold_anything(tmp_path: Path) -> None:
    append(tmp_path / FILE, AddCut(frame=1), video='a "b" \\ c')
    assert read_file(tmp_path / FILE).video == 'a "b" \\ c'


def test_the_folder_s_file_counts_unless_corrections_are_given(tmp_path: Path) -> None:
    assert decided(Config(), tmp_path).corrections.origin == "none"
    append(tmp_path / FILE, Floor(metres=0.5), video="")
    found = decided(Config(), tmp_path)
    assert found.corrections.correction == (Floor(metres=0.5),)
    given = Config.model_validate({"corrections": {"correction": [{"kind": "focal", "px": 900}]}})
    assert decided(given, tmp_path) == given
    nothing = Config.model_validate({"corrections": {"origin": "none"}})
    assert decided(nothing, tmp_path) == nothing


def test_a_finished_run_has_the_corrections_that_its_folder_holds_now(tmp_path: Path) -> None:
    append(tmp_path / FILE, Floor(metres=0.5), video="")
    runs = [decided(given, tmp_path) for given in (Config(), Config(corrections=read_file(tmp_path / FILE)))]
    (tmp_path / FILE).unlink()
    for run in runs:
        again = Config.model_validate(run.model_dump(mode="json"))  # as run.json keeps it
        for folder in (tmp_path, tmp_path / "moved"):
            assert again.corrections.correction and corrected(again, folder).corrections.correction == ()
    elsewhere = Config.model_validate(
        {"corrections": {"origin": "mine.toml", "correction": [{"kind": "focal", "px": 9}]}}
    )
    assert corrected(elsewhere, tmp_path) == elsewhere
    append(tmp_path / FILE, Floor(metres=1.0), video="")
    assert corrected(elsewhere, tmp_path).corrections.correction == (Floor(metres=1.0),)


def test_corrections_of_another_video_are_left_aside_unless_they_are_given(tmp_path: Path) -> None:
    append(tmp_path / FILE, Floor(metres=0.5), video="ab12")
    for found in (decided(Config(), tmp_path, sha256="cd34"), corrected(Config(), tmp_path, sha256="cd34")):
        assert found.corrections.correction == () and found.corrections.left_aside == (Floor(metres=0.5),)
    assert decided(Config(), tmp_path, sha256="ab12").corrections.correction == (Floor(metres=0.5),)
    given = Config(corrections=read_file(tmp_path / FILE))
    found = decided(given, tmp_path, sha256="cd34")
    assert found.corrections.correction == given.corrections.correction and not found.corrections.left_aside


def test_corrections_from_elsewhere_are_written_at_once(tmp_path: Path) -> None:
    path = tmp_path / FILE
    written = (AddCut(frame=120), SIDES)
    begin(path, written, video="ab12")
    append(path, Floor(metres=0.5), video="", remark="third")
    assert read_file(path).correction == (*written, Floor(metres=0.5)) and read_file(path).video == "ab12"
    assert path.read_text().count(f"# {SIDES}") == 1


def test_a_file_with_a_byte_order_mark_is_read_and_changed(tmp_path: Path) -> None:
    path = tmp_path / FILE
    for first in ('video = "ab12"\n', ""):
        path.write_text(f'\ufeff{first}[[correction]]\nkind = "floor"\nmetres = 0.5\n', encoding="utf-8")
        append(path, RemoveCut(frame=9), video="ab12")
        remove(path, 1)
        assert read_file(path).correction == (RemoveCut(frame=9),)
