"""What is wrong in recovered clips, and whether a warning said so, as rows and a table."""

from collections import Counter
from collections.abc import Sequence

from humanmm.models.benchmark.tables.rows import Row, exact
from humanmm.models.evaluation.doubts import CLIP, KINDS, Judgement
from humanmm.models.records.table import Table


def doubts_table(judgements: Sequence[Judgement]) -> Table:
    """A line a kind: how many there are, are wrong, have a warning, and are wrong without one."""
    head = (
        "what, and when it is wrong", "all", "wrong", "with a warning", "of these wrong", "without a warning",
        "of these wrong",
    )  # fmt: skip
    lines = []
    for kind, meaning in KINDS.items():
        count = _counts(judgements, kind)
        warned, silent = count["warned"], count["all"] - count["warned"]
        wrong_silent = count["wrong"] - count["both"]
        lines.append((
            meaning, str(count["all"]), str(count["wrong"]), str(warned), _share(count["both"], warned), str(silent),
            _share(wrong_silent, silent),
        ))  # fmt: skip
    return Table(head, tuple(lines), "What is wrong, and what was doubted")


def rows_of_doubts(judgements: Sequence[Judgement], *, failed: int) -> list[Row]:
    """A row a kind: `n` cases; the shares that are wrong, warned of, and wrong among those without a warning."""
    rows = []
    for kind in KINDS:
        count = _counts(judgements, kind)
        silent = count["all"] - count["warned"]
        shares = {
            "wrong": (count["wrong"], count["all"]),
            "warned": (count["warned"], count["all"]),
            "wrong_without_warning": (count["wrong"] - count["both"], silent),
        }
        metrics = {name: exact(part / whole) for name, (part, whole) in shares.items() if whole}
        rows.append(Row("humanmm", kind, count["all"], failed if kind == CLIP else 0, metrics))
    return rows


def _counts(judgements: Sequence[Judgement], kind: str) -> Counter[str]:
    of_kind = [one for one in judgements if one.kind == kind]
    return Counter(
        all=len(of_kind),
        wrong=sum(one.wrong for one in of_kind),
        warned=sum(one.warned for one in of_kind),
        both=sum(one.wrong and one.warned for one in of_kind),
    )


def _share(part: int, whole: int) -> str:
    return f"{part} ({part / whole:.0%})".replace("%", " %") if whole else "0"
