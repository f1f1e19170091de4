"""Rows as CSV that is safe to open in a spreadsheet."""

import csv
import io
from collections.abc import Iterable, Sequence

_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def as_csv(rows: Iterable[Sequence[object]]) -> str:
    """One line a row. A text that a spreadsheet would run as a formula gets a ' in front; numbers stay numbers."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows([_safe(cell) if isinstance(cell, str) else cell for cell in row] for row in rows)
    return text.getvalue()


def _safe(text: str) -> str:
    line = text.replace("\r", " ")  # which Python 3.11 writes without quotes, so that it would end the line
    return f"'{line}" if text.startswith(_FORMULA) else line
