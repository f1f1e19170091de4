"""A benchmark's table as files: results.json, results.csv, README.md, index.html; the same bytes for the same table."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from humanmm.errors import InputError
from humanmm.models.benchmark.tables.layout import plain_table
from humanmm.models.benchmark.tables.rows import Row
from humanmm.storage.pages.bench_page import Page, as_html
from humanmm.storage.pages.markdown import as_markdown, code, escaped
from humanmm.storage.pages.spreadsheet import as_csv
from humanmm.storage.store.files import replace_text

_COLUMNS = ("method", "split", "n", "failed", "metric", "mean", "median", "p90", "ci95_low", "ci95_high")


def write_report(folder: Path, table: str, created_by: str, rows: Sequence[Row], *, page: Page | None = None) -> None:
    """Write the four files. `created_by` is the command, without paths; without a page, the plain table is shown."""
    page = page or Page(table, created_by, "", [plain_table(rows)])
    title = f"# {escaped(page.title)}\n\nMade by {code(created_by)}. {escaped(page.facts)}".rstrip()
    texts = {
        "results.json": as_json(table, created_by, rows),
        "results.csv": as_csv([_COLUMNS, *_figures(rows)]),
        "README.md": f"{title}\n\n{as_markdown(page.tables)}",
        "index.html": as_html(page),
    }
    for name, text in texts.items():
        replace_text(folder / name, text)


def read_results(path: Path) -> dict[str, Any]:
    """The tree of a results.json; InputError if the file holds none."""
    try:
        tree = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{path} cannot be read as a results.json: {error}") from None
    if not isinstance(tree, dict):
        raise InputError(f"{path} is not a results.json: it holds no object")
    return tree


def as_json(table: str, created_by: str, rows: Sequence[Row]) -> str:
    """The text of results.json."""
    tree = {"table": table, "created_by": created_by, "rows": [_row_tree(row) for row in rows]}
    return json.dumps(tree, indent=1, ensure_ascii=False) + "\n"


def _row_tree(row: Row) -> dict[str, object]:
    metrics = {
        key: {"mean": _rounded(m.mean), "median": _rounded(m.median), "ci95": [_rounded(v) for v in m.ci95]}
        for key, m in row.metrics.items()
    }
    return {"method": row.method, "split": row.split, "n": row.n, "failed": row.failed, "metrics": metrics}


def _figures(rows: Sequence[Row]) -> list[tuple[object, ...]]:
    """One line a row and figure, as _COLUMNS names them."""
    return [
        (
            *(row.method, row.split, row.n, row.failed, key),
            *("" if value is None else _rounded(value) for value in (m.mean, m.median, m.p90, *m.ci95)),
        )
        for row in rows
        for key, m in row.metrics.items()
    ]


def _rounded(value: float) -> float:
    """Six significant digits: what differs beyond them is rounding, and files should not differ by it."""
    return float(f"{value:.6g}")
