"""Tables of results: as Markdown, as CSV, and on a terminal."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from umbel.replacing import write_all

Row = dict[str, Any]


@dataclass(frozen=True)
class Column:
    """A column: the field of the rows that it shows, its title, and how numbers are written."""

    field: str
    title: str
    form: str = ""

    def text(self, row: Row) -> str:
        value = row.get(self.field)
        return "" if value is None else format(value, self.form)

    @property
    def is_number(self) -> bool:
        return bool(self.form)


def columns(table: str) -> list[Column]:
    """Columns from lines `field | title`, or `field | title | form` for numbers."""
    lines = [line for line in table.splitlines() if line.strip()]
    return [Column(*(part.strip() for part in line.split("|"))) for line in lines]


def markdown(columns: Sequence[Column], rows: Iterable[Row]) -> str:
    """The rows as a Markdown table."""
    lines = [
        [column.title for column in columns],
        ["--:" if column.is_number else "---" for column in columns],
        *([column.text(row).replace("|", "\\|") for column in columns] for row in rows),
    ]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)


def csv_text(rows: Sequence[Row]) -> str:
    """The rows as CSV, with every field and all digits."""
    out = io.StringIO()
    writer = csv.DictWriter(out, list(rows[0]) if rows else [], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue()


def print_table(title: str, columns: Sequence[Column], rows: Iterable[Row], group: str) -> None:
    """The rows on standard output, with a line wherever the field `group` changes."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=escape(title), title_justify="left")
    for column in columns:
        table.add_column(
            escape(column.title),
            justify="right" if column.is_number else "left",
            overflow="fold",
        )
    before = None
    for row in rows:
        if before is not None and row[group] != before:
            table.add_section()
        before = row[group]
        table.add_row(*(escape(column.text(row)) for column in columns))
    Console().print(table)


def write_tables(folder: Path, texts: Mapping[str, str]) -> list[Path]:
    """Writes each text to the file of its name; the files written."""
    for name, text in texts.items():
        write_all(folder / name, [text.encode()])
    return [folder / name for name in texts]


def geometric_means(rows: Sequence[Row], by: str, fields: Sequence[str]) -> list[Row]:
    """A row for each value of the field `by`, with the geometric means of the fields over the
    rows that have them; None where one of them is 0, and where no row has one."""
    groups: dict[Any, list[Row]] = {}
    for row in rows:
        groups.setdefault(row[by], []).append(row)
    return [
        {
            by: key,
            **{
                field: _geometric_mean([row[field] for row in group if row[field] is not None])
                for field in fields
            },
        }
        for key, group in groups.items()
    ]


def _geometric_mean(values: Sequence[float]) -> float | None:
    if not values or any(value <= 0 for value in values):
        return None
    return math.exp(math.fsum(map(math.log, values)) / len(values))
