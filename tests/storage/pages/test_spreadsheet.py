"""A spreadsheet runs nothing that a user named."""

import csv
import io

from humanmm.storage.pages.spreadsheet import as_csv

HOSTILE = ("=1+1", "+1", "-1", "@SUM(A1)", "\t=1")


def test_texts_that_look_like_formulas_are_quoted_and_nothing_else_is_changed() -> None:
    rows = [list(HOSTILE), ["a=b", "", "film, 2.mp4", 'say "x"', "umlaut ä", "a-b"]]
    read = list(csv.reader(io.StringIO(as_csv(rows), newline="")))
    assert read == [[f"'{text}" for text in HOSTILE], rows[1]]


def test_a_name_with_line_breaks_stays_in_its_cell() -> None:
    text = as_csv([("a\nb", "\r=1\r2", "c")])
    assert list(csv.reader(io.StringIO(text, newline=""))) == [["a\nb", "' =1 2", "c"]]


def test_numbers_stay_numbers() -> None:
    assert as_csv([(-1.5, 2, "")]) == "-1.5,2,\n"
