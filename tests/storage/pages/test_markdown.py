"""Markdown takes names as they are: what is read from it is what was written."""

import re

import pytest

from humanmm.models.records.table import Code, Table
from humanmm.storage.pages.markdown import as_markdown, code, escaped

HOSTILE = (
    "<script>alert(1)</script>",
    "[click](http://evil.example)",
    "[12](http://evil.example)",
    "[12]: http://evil.example",
    "![x](http://evil.example/p.png)",
    "a | b",
    "`code` **bold** _it_ ~~gone~~",
    "# title\n\n- item",
    "&lt;b&gt;",
    "back\\slash",
)


def _read(markdown: str) -> str:
    """What a reader of CommonMark shows of a text without markup: backslash escapes are taken away."""
    return re.sub(r"\\([!-/:-@\[-`{-~])", r"\1", markdown)


@pytest.mark.parametrize("text", HOSTILE)
def test_a_name_is_read_as_it_was_written_and_marks_nothing_up(text: str) -> None:
    line = escaped(text)
    assert _read(line) == " ".join(text.split())
    bare = re.sub(r"\\.", "", line)
    assert not re.search(r"[<>`*|#!&~]|\]\(|\]:", bare)
    assert not re.search(r"(?<!\w)_|_(?!\w)", bare)


def test_intervals_and_keys_stay_readable() -> None:
    assert escaped("12 [8, 16]") == "12 [8, 16]"
    assert escaped("[-1.5, 2]") == "[-1.5, 2]"
    assert escaped("cam_cut_rot_deg") == "cam_cut_rot_deg"


def test_code_is_fenced_by_more_backticks_than_it_holds() -> None:
    assert code("runs/a") == "`runs/a`"
    assert code("a ``b`` c") == "``` a ``b`` c ```"


def test_a_table_has_as_many_columns_as_its_head_whatever_the_cells_hold() -> None:
    table = Table(("", "a | b"), ((Code("roe|deg"), "1 | 2"), ("x", "")), "of <us>")
    title, _, *lines = as_markdown([table]).splitlines()
    assert title == "## of \\<us\\>"
    assert [len(re.findall(r"(?<!\\)\|", line)) for line in lines] == [3] * 4
    assert lines[1] == "|---|---:|"
