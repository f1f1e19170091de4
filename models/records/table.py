"""A table of a report, before it is written as Markdown or HTML."""

from dataclasses import dataclass


class Code(str):
    """A cell in a program's words, such as the key of a figure."""

    __slots__ = ()


@dataclass(frozen=True)
class Table:
    """Plain texts, not Markdown or HTML: the writers escape them."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    title: str = ""
