"""Texts and tables as Markdown. Names and messages of users are escaped: no markup of theirs takes effect."""

import re
from collections.abc import Sequence

from humanmm.models.records.table import Code, Table

_MARKUP = re.compile(r"[\\`*#|<>!&~]|\[(?!-?\d)|\](?=[(\[:])|(?<!\w)_|_(?!\w)")
"""What could mark text up. An interval such as [8, 16] and an underscore inside a word cannot."""


def escaped(text: str) -> str:
    """One line of plain text."""
    return _MARKUP.sub(r"\\\g<0>", " ".join(text.split())).encode("utf-8", "backslashreplace").decode()


def code(text: str) -> str:
    """A span of code, fenced by more backticks than the text has in a row."""
    line = " ".join(text.split()).encode("utf-8", "backslashreplace").decode()
    fence = "`" * (1 + max((len(run) for run in re.findall("`+", line)), default=0))
    return f"{fence} {line} {fence}" if len(fence) > 1 else f"`{line}`"


def as_markdown(tables: Sequence[Table]) -> str:
    """The tables under their titles; the first column is aligned to the left, the others to the right."""
    return "\n".join(_table(table) for table in tables)


def _table(table: Table) -> str:
    head, *body = ("| " + " | ".join(map(_cell, line)) + " |\n" for line in (table.head, *table.rows))
    title = f"## {escaped(table.title)}\n\n" if table.title else ""
    return f"{title}{head}|---|{'---:|' * (len(table.head) - 1)}\n{''.join(body)}"


def _cell(text: str) -> str:
    return code(text).replace("|", "\\|") if isinstance(text, Code) else escaped(text)
