"""A benchmark's table as files: results.json, results.csv, README.md, index.html; the same bytes for the same table."""

import csv
import functools
import io
import json
from collections.abc import Sequence
from pathlib import Path

from humanmm.models.benchmark.tables.rows import Metric, Row
from humanmm.storage.pages.bench_page import Page, as_html
from humanmm.storage.store.files import replace_file


def write_report(
    folder: Path,
    table: str,
    created_by: str,
    rows: Sequence[Row],
    *,
    page: Page | None = None,
) -> None:
    """Write the four files. `created_by` is the command, without paths; the plain table is shown where no page is
    given."""
    page = page or Page(table, created_by, "", as_markdown(rows))
    texts = {
        "results.json": as_json(table, created_by, rows),
        "results.csv": _as_csv(rows),
        "README.md": f"# {page.title}\n\nMade by `{created_by}`. {page.facts}".rstrip() + f"\n\n{page.table}",
        "index.html": as_html(page),
    }
    for name, text in texts.items():
        replace_file(folder / name, functools.partial(_write, text))


def as_json(table: str, created_by: str, rows: Sequence[Row]) -> str:
    """The text of results.json."""
    tree = {"table": table, "created_by": created_by, "rows": [_row_tree(row) for row in rows]}
    return json.dumps(tree, indent=1, ensure_ascii=False) + "\n"


def as_markdown(rows: Sequence[Row]) -> str:
    """The table in Markdown: a line a figure, a column a row of the benchmark; the interval where there is one."""
    lines = [
        "| | " + " | ".join(f"{row.method}, {row.split} (n = {row.n}, failed {row.failed})" for row in rows) + " |",
        "|---|" + "---:|" * len(rows),
    ]
    for key in _keys(rows):
        cells = [_cell(row.metrics[key]) if key in row.metrics else "" for row in rows]
        lines.append(f"| `{key}` | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _row_tree(row: Row) -> dict[str, object]:
    metrics = {
        key: {"mean": _rounded(m.mean), "median": _rounded(m.median), "ci95": [_rounded(v) for v in m.ci95]}
        for key, m in row.metrics.items()
    }
    return {"method": row.method, "split": row.split, "n": row.n, "failed": row.failed, "metrics": metrics}


def _as_csv(rows: Sequence[Row]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["method", "split", "n", "failed", "metric", "mean", "median", "ci95_low", "ci95_high"])
    for row in rows:
        for key, m in row.metrics.items():
            figures = [_rounded(value) for value in (m.mean, m.median, *m.ci95)]
            writer.writerow([row.method, row.split, row.n, row.failed, key, *figures])
    return text.getvalue()


def _keys(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(key for row in rows for key in row.metrics))


def _cell(metric: Metric) -> str:
    low, high = metric.ci95
    text = f"{metric.mean:.4g}"
    return text if low == high else f"{text} [{low:.4g}, {high:.4g}]"


def _rounded(value: float) -> float:
    """Six significant digits: what differs beyond them is rounding, and files should not differ by it."""
    return float(f"{value:.6g}")


def _write(text: str, path: Path) -> None:
    path.write_text(text, encoding="utf-8")
